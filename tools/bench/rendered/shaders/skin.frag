#version 330
// Skin, nails and cloth under three lights with soft shadows.
//COMMON
const int LIGHTS = 3;
const int TAPS = 4;
uniform sampler2DShadow shadow[LIGHTS];
uniform mat4 light_clip[LIGHTS];
uniform vec3 light_direction[LIGHTS];
uniform vec3 light_colour[LIGHTS];
uniform vec3 ambient_above;
uniform vec3 ambient_below;
uniform vec3 eye;
uniform vec3 tone;        // skin of the back of the hand, linear
uniform vec3 tone_palm;
uniform vec3 cloth;
uniform vec4 joints_mm[5];  // of each finger: where its base, two hinges and tip lie along it
uniform float half_mm[5];   // half the width of its last bone
uniform float exposure;
uniform float seed;
uniform float roughness;
uniform float wrinkles;
uniform int material;       // 0 hand, 1 arm, 2 cloth
in vec3 at;
in vec3 facing;
in vec3 rest_mm;
in vec3 local_mm;
in vec3 slow;
flat in int digit;
out vec4 colour;

float lit(int i, vec3 n, float turn) {
    vec4 p = light_clip[i] * vec4(at + 0.0015 * n, 1.0);
    vec3 q = p.xyz / p.w * 0.5 + 0.5;
    float sum = 0.0;
    for (int k = 0; k < TAPS; ++k) {
        float r = sqrt((float(k) + 0.5) / float(TAPS)) * 0.016, a = 2.39996 * float(k) + turn;
        vec3 c = vec3(q.xy + r * vec2(cos(a), sin(a)), q.z - 0.002);
        if (i == 0) sum += texture(shadow[0], c);
        else if (i == 1) sum += texture(shadow[1], c);
        else sum += texture(shadow[2], c);
    }
    return sum / float(TAPS);
}

float segment(vec2 p, vec2 a, vec2 b) {
    vec2 d = b - a;
    return length(p - a - d * clamp(dot(p - a, d) / dot(d, d), 0.0, 1.0));
}

float line(float distance, float width) { return exp(-distance * distance / (width * width)); }

// the palm's three lines and the creases at the hinges; rest_mm is of a right hand of mean size
float creases(float palmar) {
    float wobble = 1.6 * slow.y;
    float found = 0.0;
    if (palmar > 0.0 && digit < 0) {
        vec2 p = rest_mm.xy + wobble;
        float heart = min(segment(p, vec2(62, -46), vec2(73, -24)), segment(p, vec2(73, -24), vec2(88, 8)));
        float head = min(segment(p, vec2(77, 27), vec2(66, 2)), segment(p, vec2(66, 2), vec2(44, -30)));
        float life = min(segment(p, vec2(77, 27), vec2(58, 8)), segment(p, vec2(58, 8), vec2(14, 1)));
        found = max(max(line(heart, 0.9), line(head, 0.9)), line(life, 0.9));
        found = max(found, 0.6 * line(rest_mm.x + 3.0 + wobble, 0.9));
        found *= smoothstep(0.0, 0.5, palmar);
    }
    if (digit >= 0) {
        vec4 j = joints_mm[digit];
        float s = local_mm.x + 0.7 * wobble;
        if (palmar > 0.0) {
            float base = digit == 0 ? j.y : j.x + 0.42 * (j.y - j.x);
            float near = max(line(s - j.z, 0.7), 0.8 * line(s - j.z + 2.2, 0.5));
            near = max(near, max(line(s - j.y, 0.7), digit == 0 ? 0.0 : 0.9 * line(s - j.y - 2.2, 0.6)));
            found = max(near, line(s - base, 0.8));
        } else {
            float around = line(s - j.y, 5.0) + 0.7 * line(s - j.z, 3.2);
            found = 0.75 * around * smoothstep(0.55, 0.9, 0.5 + 0.5 * sin(2.6 * s + 3.0 * wobble));
        }
    }
    return wrinkles * found;
}

float nail() {
    if (digit < 0 || local_mm.z < 0.0) return 0.0;
    float long_mm = 1.45 * half_mm[digit], end = joints_mm[digit].w - 0.3;
    vec2 p = vec2((local_mm.x - end + 0.5 * long_mm) / (0.5 * long_mm), local_mm.y / (0.66 * half_mm[digit]));
    return 1.0 - smoothstep(0.85, 1.05, pow(pow(abs(p.x), 4.0) + pow(abs(p.y), 4.0), 0.25));
}

vec3 bumped(vec3 n, float height_mm) {
    vec3 dx = dFdx(at), dy = dFdy(at);
    vec3 r1 = cross(dy, n), r2 = cross(n, dx);
    float det = dot(dx, r1);
    vec3 gradient = sign(det) * (dFdx(height_mm) * r1 + dFdy(height_mm) * r2) * 1e-3;
    return normalize(abs(det) * n - gradient);
}

void main() {
    vec3 n = normalize(facing);
    vec3 view = normalize(eye - at);
    if (dot(n, view) < 0.0) n = -n;
    vec3 base;
    float shine = 0.04, rough = roughness, red = 0.0;
    if (material == 2) {
        float weave = 0.5 + 0.5 * sin(rest_mm.x * 3.1) * sin(rest_mm.y * 3.1 + rest_mm.z * 2.3);
        float folds = slow.z;
        base = cloth * (0.75 + 0.2 * weave + 0.25 * folds);
        n = bumped(n, 4.0 * slow.z);
        shine = 0.01;
        rough = 0.9;
    } else {
        float palmar = material == 0 ? -local_mm.z / 8.0 : -rest_mm.z / 8.0;
        // at the wrist the palm's colour goes over into the arm's
        float near_wrist = material == 0 ? smoothstep(-5.0, 35.0, rest_mm.x) : 0.0;
        float inner = smoothstep(-0.5, 0.7, palmar) * mix(0.35, 1.0, near_wrist);
        float blotch = slow.x;
        float fine = noise(rest_mm * 0.9 + seed) - 0.5;
        base = mix(tone, tone_palm, inner);
        base *= 0.86 + 0.16 * blotch + 0.07 * fine;
        float tendon = 0.0;
        if (material == 0) {
            float crease = creases(palmar);
            float plate = nail();
            if (digit >= 0) {
                vec4 j = joints_mm[digit];
                float tip = smoothstep(j.w - 22.0, j.w, local_mm.x);
                float knuckle = (1.0 - inner) * (line(local_mm.x - j.y, 6.0) + line(local_mm.x - j.x, 7.0));
                red = 0.55 * tip * inner + 0.35 * tip + 0.45 * knuckle;
            } else if (palmar < 0.0) {
                tendon = line(local_mm.y, 2.2) * smoothstep(15.0, 35.0, rest_mm.x);
            } else {
                red = 0.5 * smoothstep(0.2, 1.0, slow.z);
            }
            base *= mix(vec3(1.0), vec3(1.06, 0.86, 0.84), red);
            base *= mix(vec3(1.0), vec3(0.60, 0.48, 0.45), 0.75 * crease);
            float free_edge = smoothstep(1.5, 0.3, joints_mm[max(digit, 0)].w - local_mm.x);
            vec3 plate_colour = mix(1.12 * mix(tone_palm, vec3(0.75, 0.5, 0.45), 0.5), vec3(0.8, 0.74, 0.68), free_edge);
            base = mix(base, plate_colour, 0.8 * plate);
            rough = mix(rough, 0.28, plate);
            n = bumped(n, 0.25 * fine + 0.6 * tendon - 0.45 * crease + 0.25 * plate);
        } else {
            n = bumped(n, 0.3 * fine + 0.8 * slow.z);
        }
    }
    float flesh = material == 2 ? 0.0 : 1.0;
    vec3 sum = vec3(0.0);
    float open = 0.0;
    float turn = 6.2831 * hash(vec3(gl_FragCoord.xy * 0.37, seed));
    for (int i = 0; i < LIGHTS; ++i) {
        vec3 l = -light_direction[i];
        float shade = lit(i, n, turn);
        float c = dot(n, l);
        // light that enters the skin comes out around the terminator, red first
        vec3 wrap = flesh * vec3(0.32, 0.14, 0.09);
        vec3 diffuse = clamp((c + wrap) / (1.0 + wrap), 0.0, 1.0);
        vec3 through = mix(vec3(shade), vec3(1.0), flesh * vec3(0.16, 0.04, 0.02));
        vec3 h = normalize(l + view);
        float power = 2.0 / (rough * rough * rough * rough + 1e-3);
        float fresnel = shine + (1.0 - shine) * pow(1.0 - max(dot(h, view), 0.0), 5.0);
        float glint = fresnel * (power + 2.0) / 8.0 * pow(max(dot(n, h), 0.0), power);
        sum += light_colour[i] * (base * diffuse * through + glint * max(c, 0.0) * shade);
        open += shade / float(LIGHTS);
    }
    vec3 ambient = mix(ambient_below, ambient_above, 0.5 + 0.5 * n.z);
    sum += base * ambient * mix(vec3(0.45, 0.38, 0.36), vec3(1.0), open);
    colour = vec4(toned(sum, exposure), 1.0);
}
