#version 330
// World points to a picture whose first row is the first in memory (y is turned over).
//COMMON
uniform mat4 clip;
uniform float seed;
in vec3 position;
in vec3 normal;
in vec3 rest;
in vec3 local;
in float finger;
out vec3 at;
out vec3 facing;
out vec3 rest_mm;
out vec3 local_mm;
out vec3 slow;  // noise that changes over millimetres: blotches, wobble of lines, redness
flat out int digit;

void main() {
    at = position;
    facing = normal;
    rest_mm = rest;
    local_mm = local;
    digit = int(finger + (finger < 0.0 ? -0.5 : 0.5));
    slow.x = noise(rest * 0.07 + seed) + 0.5 * noise(rest * 0.19 + 7.0 * seed);
    slow.y = noise(rest * 0.12 + seed) - 0.5;
    slow.z = noise(rest * 0.045 + 3.0 * seed);
    gl_Position = clip * vec4(position, 1.0);
}
