// Shared by all programs: value noise in three dimensions, and the picture's transfer curve.

float hash(vec3 p) {
    p = fract(p * 0.3183099 + vec3(0.1, 0.2, 0.3));
    p *= 17.0;
    return fract(p.x * p.y * p.z * (p.x + p.y + p.z));
}

float noise(vec3 x) {
    vec3 i = floor(x), f = fract(x);
    f = f * f * (3.0 - 2.0 * f);
    return mix(mix(mix(hash(i), hash(i + vec3(1, 0, 0)), f.x),
                   mix(hash(i + vec3(0, 1, 0)), hash(i + vec3(1, 1, 0)), f.x), f.y),
               mix(mix(hash(i + vec3(0, 0, 1)), hash(i + vec3(1, 0, 1)), f.x),
                   mix(hash(i + vec3(0, 1, 1)), hash(i + vec3(1, 1, 1)), f.x), f.y), f.z);
}

vec3 toned(vec3 linear, float exposure) {
    vec3 x = max(linear * exposure, 0.0);
    x = x * (1.0 + x / 4.0) / (1.0 + x);  // Reinhard's curve with white at 2
    return pow(clamp(x, 0.0, 1.0), vec3(1.0 / 2.2));
}
