/* textbook.cl: the tracer of every textbook, which the benchmark takes as its baseline. It is no part of cltrace
 * itself.
 *
 * float32 in world coordinates, the quadratic formula as it is taught, a small step off the surface for shadow rays,
 * and every ray tries every sphere. One work-item is one pixel. It draws what trace.cl draws, and as well as that
 * recipe can.
 */

/* How far a shadow ray must have come before it may hit something, in scene units: against shadows of a surface on
 * itself. */
#define EPSILON 1e-3f

/* Kinds of light, as in cltrace/scene.py. */
#define AMBIENT 0
#define PARALLEL 1
#define SPOT 3

typedef struct {
    float4 eye, right, up, back; /* right, up: times the size of a pixel */
    float4 background;
    int4 size; /* width, height, spheres, lights */
} Setup;

/* position, or the direction to a parallel light; w: its kind. axis, of a spot light; w: cosine of alpha2.
 * color; w: alpha1. cone: x: alpha2 - alpha1. */
typedef struct {
    float4 position, axis, color, cone;
} Lamp;

/* The nearest t > t_min at which the ray meets the sphere, or INFINITY. */
static float hit_sphere(const float3 origin, const float3 direction, const float4 sphere, const float t_min) {
    const float3 from_center = origin - sphere.xyz;
    const float a = dot(direction, direction);
    const float b = 2 * dot(from_center, direction);
    const float c = dot(from_center, from_center) - sphere.w * sphere.w;
    const float discriminant = b * b - 4 * a * c;
    if (discriminant < 0) return INFINITY;
    const float root = sqrt(discriminant);
    const float near = (-b - root) / (2 * a), far = (-b + root) / (2 * a);
    return near > t_min ? near : far > t_min ? far : INFINITY;
}

static bool in_shadow(__global const float4 *spheres, const int count, const float3 p, const float3 l,
                      const float far) {
    for (int i = 0; i < count; i++)
        if (hit_sphere(p, l, spheres[i], EPSILON) < far) return true;
    return false;
}

__kernel void render(const Setup setup, __global const float4 *spheres, __global const int *material_of,
                     __global const float8 *materials, __global const Lamp *lights, __global uchar *rgb8,
                     __global float *color, __global float *normal, __global float *depth, __global int *id) {
    const int x = get_global_id(0), y = get_global_id(1);
    const int width = setup.size.x, height = setup.size.y, count = setup.size.z;
    if (x >= width || y >= height) return;

    const float3 origin = setup.eye.xyz;
    const float3 direction = normalize((2 * x + 1 - width) * setup.right.xyz + (height - 1 - 2 * y) * setup.up.xyz -
                                       setup.back.xyz);
    float nearest = INFINITY;
    int hit = -1;
    for (int i = 0; i < count; i++) {
        const float t = hit_sphere(origin, direction, spheres[i], 0);
        if (t < nearest) {
            nearest = t;
            hit = i;
        }
    }

    float3 n = 0, c = setup.background.xyz;
    if (hit >= 0) {
        const float3 p = origin + nearest * direction;
        n = (p - spheres[hit].xyz) / spheres[hit].w;
        if (dot(n, direction) > 0) n = -n;
        const float8 material = materials[material_of[hit]]; /* colour, ka, kd, ks, exponent */
        c = 0;
        for (int k = 0; k < setup.size.w; k++) {
            const Lamp light = lights[k];
            const int kind = (int)light.position.w;
            if (kind == AMBIENT) {
                c += material.s3 * material.s012 * light.color.xyz;
                continue;
            }
            const float3 way = kind == PARALLEL ? light.position.xyz : light.position.xyz - p;
            const float far = kind == PARALLEL ? INFINITY : length(way);
            const float3 l = normalize(way);
            const float n_l = dot(n, l);
            if (n_l <= 0) continue;
            float strength = 1;
            if (kind == SPOT) {
                const float cosine = -dot(l, light.axis.xyz);
                if (cosine < light.axis.w) continue;
                if (light.cone.x > 0)
                    strength = clamp(1 - (acos(min(cosine, 1.0f)) - light.color.w) / light.cone.x, 0.0f, 1.0f);
            }
            if (in_shadow(spheres, count, p, l, far)) continue;
            const float r_v = max(0.0f, -dot(2 * n_l * n - l, direction));
            c += strength * (material.s4 * material.s012 * n_l + material.s5 * pow(r_v, material.s6)) * light.color.xyz;
        }
    }
    const int at = y * width + x;
    const float3 byte = clamp(c, 0.0f, 1.0f) * 255 + 0.5f;
    vstore3(convert_uchar3(byte), at, rgb8);
    vstore3(c, at, color);
    vstore3(n, at, normal);
    depth[at] = nearest;
    id[at] = hit;
}
