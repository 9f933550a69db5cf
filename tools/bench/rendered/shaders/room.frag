#version 330
// Walls, floor and furniture. local_mm holds the colour, rest_mm the point on the thing in m,
// digit its kind of surface: 0 plain, 1 wood, 2 rows of books, 3 woven, 4 shining.
//COMMON
uniform vec3 light_direction[3];
uniform vec3 light_colour[3];
uniform vec3 ambient_above;
uniform vec3 ambient_below;
uniform float exposure;
uniform float seed;
in vec3 at;
in vec3 facing;
in vec3 rest_mm;
in vec3 local_mm;
flat in int digit;
out vec4 colour;

void main() {
    vec3 n = normalize(facing), base = local_mm, x = rest_mm;
    base *= 0.85 + 0.3 * noise(x * 3.0 + seed);
    if (digit == 1) base *= 0.75 + 0.5 * noise(vec3(x.x * 2.0, x.y * 40.0, x.z * 40.0));
    if (digit == 2) {
        vec3 shelf = floor(vec3(x.x * 28.0, x.y * 28.0, x.z * 3.2));
        vec3 cover = vec3(hash(shelf), hash(shelf + 11.0), hash(shelf + 23.0));
        base = 0.55 * mix(vec3(dot(cover, vec3(0.33))), cover, 0.45);
        base *= smoothstep(0.0, 0.12, fract(x.z * 3.2)) * (1.0 - smoothstep(0.75, 0.8, fract(x.z * 3.2)));
    }
    if (digit == 3) base *= 0.7 + 0.3 * step(0.5, fract(x.x * 6.0)) + 0.3 * step(0.5, fract(x.z * 6.0));
    vec3 sum = base * mix(ambient_below, ambient_above, 0.5 + 0.5 * n.z);
    for (int i = 0; i < 3; ++i) sum += 0.55 * base * light_colour[i] * max(dot(n, -light_direction[i]), 0.0);
    // farther from the lamps it is darker
    sum *= 1.15 - 0.12 * length(at);
    if (digit == 4) sum = base * 2.2;
    colour = vec4(toned(sum, exposure), 1.0);
}
