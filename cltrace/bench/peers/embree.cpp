/* Draws a scene with Embree 3, as the benchmark's peer: spheres, triangles and cylinders (as its linear cones),
ambient, parallel, point and spot lights with shadows, Phong, mirrors and glass, in single precision.

    embree SCENE FRAMES PICTURE [ROBUST [WAY]]
    embree                                        (writes Embree's version)

SCENE is what embree.py writes: a Head, then the arrays of Scene, in camera space, in which the camera looks along -z.
ROBUST is 0 or 1, Embree's flag of that name. There are three ways to draw: 0 and 1 with packets of as many rays as the
processor has lanes, with Embree's flag for coherent rays for the rays of the camera alone and for all of them, and 2
with single rays. Without WAY all of them draw, slow ones one frame. Written to stdout is one line of JSON: the way that
had the best frame, the seconds of all its frames, and those of building the tree. PICTURE gets the bytes of the pixels,
row by row from the top, red, green and blue.

New rays start off the surface, along its normal, by 2^-20 of the point's distances from the eye and from where its ray
began, and of the sphere's radius: the usual epsilon of a tracer in single precision, as Embree has no exact one. */
#include <embree3/rtcore.h>
#include <immintrin.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#ifdef __AVX512F__
constexpr int LANES = 16, LANES_ACROSS = 4;
#else
constexpr int LANES = 8, LANES_ACROSS = 4;
#endif
constexpr int TILE = 16;          // pixels a side, which a thread takes at once
constexpr float OFF = 0x1p-20f;   // of the distances, by which new rays start off a surface
constexpr float FAINT = 0x1p-13f; // rays that count for less show nothing: half a level at most
enum Kind { AMBIENT, PARALLEL, POINT, SPOT, LAMBERT };

struct Head {
    int width, height, samples, bounces, orthographic; // samples: across a pixel, and down
    int spheres, vertices, normals, triangles, cylinders, materials, textures, texels, lights;
    float half_width, half_height; // of the image plane at distance 1, or of an orthographic picture
    float background[3];
    float basis[9]; // of the camera, in the world: right, up, back
};
struct Light {
    int kind;
    float place[3], color[3], axis[3]; // place: of a parallel light the way to it, length 1; axis: along its light
    float inner, outer;                // radians from the axis
};
struct Scene {
    Head head;
    std::vector<float> spheres, vertices, normals; // x, y, z, radius; x, y, z; x, y, z
    std::vector<int> corners, normal_of;           // three of each a triangle; normal_of -1: flat
    std::vector<float> uv;                         // of the three corners of each triangle
    std::vector<float> cylinders;                  // x, y, z and radius of both ends
    std::vector<int> material_of;                  // of spheres, of triangles, then of cylinders
    std::vector<float> materials;                  // rows of COLUMNS
    std::vector<int> textures;                     // the first pixel, width, height
    std::vector<float> texels;                     // red, green, blue of each pixel
    std::vector<Light> lights;
    int exponent; // which all materials have, if it is a whole number, else 0
};
constexpr int RED = 0, GREEN = 1, BLUE = 2, KA = 3, KD = 4, KS = 5, EXPONENT = 6, MIRROR = 7, CLEAR = 8, INDEX = 9;
constexpr int TEXTURE = 10, COLUMNS = 11; // TEXTURE: its number, -1 for none

static Scene scene;
static RTCScene tree;
static std::vector<unsigned> ends; // of cylinders: where each begins among these
static std::vector<unsigned char> picture;

/* Vectors of N lanes, of which the compiler makes the processor's own; one lane is a vector, too. */
template <int N> struct Wide {
    typedef float F __attribute__((vector_size(4 * N)));
    typedef int I __attribute__((vector_size(4 * N)));
};
template <class F, class I> static F choose(I where, F yes, F no) {
    return (F)(((I)yes & where) | ((I)no & ~where));
}
template <class I> static bool any(I where) {
    int found = 0;
    for (size_t k = 0; k < sizeof(I) / 4; k++) found |= where[k];
    return found;
}
template <class F> static F root(F x) {
    for (size_t k = 0; k < sizeof(F) / 4; k++) x[k] = sqrtf(x[k]);
    return x;
}
template <class F> static F most(F a, F b) {
    return choose(a > b, a, b);
}
template <class F, class I> static F gather(const float *from, I at) {
    F out;
    for (size_t k = 0; k < sizeof(I) / 4; k++) out[k] = from[at[k]];
    return out;
}
template <class I> static I gather_int(const int *from, I at) {
    for (size_t k = 0; k < sizeof(I) / 4; k++) at[k] = from[at[k]];
    return at;
}
template <class F> static F power(F base, F exponent) {
    if (scene.exponent) {
        F out = F{} + 1;
        for (int left = scene.exponent; left; left >>= 1, base = base * base)
            if (left & 1) out = out * base;
        return out;
    }
    for (size_t k = 0; k < sizeof(F) / 4; k++) base[k] = powf(base[k], exponent[k]);
    return base;
}
template <class Slot, class V> static void put(Slot &slot, V value) {
    static_assert(sizeof slot == sizeof value, "");
    memcpy(&slot, &value, sizeof value);
}
template <class V, class Slot> static V get(const Slot &slot) {
    V value;
    static_assert(sizeof slot == sizeof value, "");
    memcpy(&value, &slot, sizeof value);
    return value;
}

template <class F> struct Vec {
    F x, y, z;
};
template <class F> static Vec<F> operator+(Vec<F> a, Vec<F> b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class F> static Vec<F> operator-(Vec<F> a, Vec<F> b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class F> static Vec<F> operator*(Vec<F> a, F k) {
    return {a.x * k, a.y * k, a.z * k};
}
template <class F> static F dot(Vec<F> a, Vec<F> b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class F> static Vec<F> unit(Vec<F> a) {
    return a * (1.f / root(dot(a, a)));
}
template <class F> static Vec<F> all(const float *v) {
    return {F{} + v[0], F{} + v[1], F{} + v[2]};
}
template <class F, class I> static Vec<F> choose(I where, Vec<F> a, Vec<F> b) {
    return {choose(where, a.x, b.x), choose(where, a.y, b.y), choose(where, a.z, b.z)};
}
template <class F, class I> static Vec<F> gather3(const std::vector<float> &from, int step, I at) {
    return {gather<F>(from.data(), at * step), gather<F>(from.data() + 1, at * step),
            gather<F>(from.data() + 2, at * step)};
}

/* Embree's calls for one ray and for a packet. */
template <int N> struct Calls;
template <> struct Calls<1> {
    typedef RTCRay Ray;
    typedef RTCRayHit RayHit;
    static void closest(const int *, RTCIntersectContext *context, RayHit &r) {
        rtcIntersect1(tree, context, &r);
    }
    static void occluded(const int *, RTCIntersectContext *context, Ray &r) {
        rtcOccluded1(tree, context, &r);
    }
};
#ifdef __AVX512F__
template <> struct Calls<16> {
    typedef RTCRay16 Ray;
    typedef RTCRayHit16 RayHit;
    static void closest(const int *on, RTCIntersectContext *context, RayHit &r) {
        rtcIntersect16(on, tree, context, &r);
    }
    static void occluded(const int *on, RTCIntersectContext *context, Ray &r) {
        rtcOccluded16(on, tree, context, &r);
    }
};
#else
template <> struct Calls<8> {
    typedef RTCRay8 Ray;
    typedef RTCRayHit8 RayHit;
    static void closest(const int *on, RTCIntersectContext *context, RayHit &r) {
        rtcIntersect8(on, tree, context, &r);
    }
    static void occluded(const int *on, RTCIntersectContext *context, Ray &r) {
        rtcOccluded8(on, tree, context, &r);
    }
};
#endif

template <int N> struct Tracer {
    typedef typename Wide<N>::F F;
    typedef typename Wide<N>::I I;
    typedef Vec<F> V;
    typedef Calls<N> Call;

    bool all_coherent;

    struct Rays {
        V origin, direction;
        F near, weight; // near: from where on surfaces count; weight: of the colour in the picture, 0: no ray
        I live;
    };
    struct Hit {
        I there, inside, material;
        V point, normal; // normal: of length 1, against the ray
        F off;           // by which new rays start off the surface
        F u, v;          // where it is in a texture
    };

    RTCIntersectContext context(int depth) const {
        RTCIntersectContext made;
        rtcInitIntersectContext(&made);
        made.flags = depth == 0 || all_coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT
                                                : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
        return made;
    }

    static void aim(typename Call::Ray &ray, V o, V d, F near, F far) {
        put(ray.org_x, o.x), put(ray.org_y, o.y), put(ray.org_z, o.z);
        put(ray.dir_x, d.x), put(ray.dir_y, d.y), put(ray.dir_z, d.z);
        put(ray.tnear, near), put(ray.tfar, far), put(ray.time, F{});
        put(ray.mask, I{} - 1), put(ray.id, I{}), put(ray.flags, I{});
    }

    Hit closest(const Rays &rays, int depth) const {
        alignas(64) typename Call::RayHit found;
        aim(found.ray, rays.origin, rays.direction, rays.near, F{} + INFINITY);
        put(found.hit.geomID, I{} - 1), put(found.hit.instID[0], I{} - 1);
        RTCIntersectContext how = context(depth);
        alignas(64) I live = rays.live;
        Call::closest((const int *)&live, &how, found);
        Hit hit;
        I shape = get<I>(found.hit.geomID);
        hit.there = live & (shape != -1);
        I of_triangles = hit.there & (shape == 1), number = hit.there & get<I>(found.hit.primID);
        I first = (of_triangles & scene.head.spheres) +
                  (hit.there & (shape == 2) & (scene.head.spheres + scene.head.triangles));
        hit.material = gather_int(scene.material_of.data(), number + first);
        F t = choose(hit.there, get<F>(found.ray.tfar), F{} + 1);
        hit.point = rays.origin + rays.direction * t;
        V flat = {get<F>(found.hit.Ng_x), get<F>(found.hit.Ng_y), get<F>(found.hit.Ng_z)}, n = flat;
        if (any(of_triangles)) n = smooth(of_triangles, number, get<F>(found.hit.u), get<F>(found.hit.v), flat);
        hit.inside = hit.there & (dot(flat, rays.direction) > 0);
        n = unit(choose(hit.there, n, V{F{}, F{}, F{} + 1}));
        if (scene.head.textures) place(hit, of_triangles, number, get<F>(found.hit.u), get<F>(found.hit.v), n);
        hit.normal = choose(hit.inside, n * (F{} - 1), n);
        F size = root(dot(hit.point, hit.point)) + t;
        I of_spheres = hit.there & (shape == 0);
        if (any(of_spheres))
            size = size + choose(of_spheres, gather<F>(scene.spheres.data() + 3, (number & of_spheres) * 4), F{});
        hit.off = size * OFF;
        return hit;
    }

    static V smooth(I of_triangles, I number, F u, F v, V flat) {
        I at = of_triangles & (number * 3), first = gather_int(scene.normal_of.data(), at);
        I has = of_triangles & (first >= 0);
        if (!any(has)) return flat;
        I second = gather_int(scene.normal_of.data() + 1, at), third = gather_int(scene.normal_of.data() + 2, at);
        V a = gather3<F>(scene.normals, 3, first & has), b = gather3<F>(scene.normals, 3, second & has);
        V c = gather3<F>(scene.normals, 3, third & has);
        return choose(has, a * (1 - u - v) + b * u + c * v, flat);
    }

    /* Where hits are in their textures. n: the normals to the outside, in camera space. */
    static void place(Hit &hit, I of_triangles, I number, F b, F c, V n) {
        const float *basis = scene.head.basis;
        for (int k = 0; k < N; k++) {
            float world[3];
            for (int i = 0; i < 3; i++) world[i] = n.x[k] * basis[i] + n.y[k] * basis[3 + i] + n.z[k] * basis[6 + i];
            hit.u[k] = .5f + atan2f(world[0] + 0.f, world[2]) / (float)(2 * M_PI);
            hit.v[k] = atan2f(hypotf(world[0], world[2]), world[1]) / (float)M_PI;
            if (!of_triangles[k]) continue;
            const float *uv = &scene.uv[6 * number[k]], a = 1 - b[k] - c[k];
            hit.u[k] = a * uv[0] + b[k] * uv[2] + c[k] * uv[4], hit.v[k] = a * uv[1] + b[k] * uv[3] + c[k] * uv[5];
        }
    }

    /* The colour of a texture: of the four pixels around, each the more the nearer. */
    static void paint(Vec<F> &color, const Hit &hit) {
        for (int k = 0; k < N; k++) {
            const int texture = scene.materials[hit.material[k] * COLUMNS + TEXTURE];
            if (texture < 0 || !hit.there[k]) continue;
            const int *t = &scene.textures[3 * texture];
            float x = (hit.u[k] - floorf(hit.u[k])) * t[1], y = (hit.v[k] - floorf(hit.v[k])) * t[2];
            const int i = x, j = y;
            x -= i, y -= j;
            auto at = [&](int column, int row) {
                return &scene.texels[3 * (t[0] + row % t[2] * t[1] + column % t[1])];
            };
            const float *from[] = {at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)};
            auto mixed = [&](int c) {
                return (from[0][c] * (1 - x) + from[1][c] * x) * (1 - y) + (from[2][c] * (1 - x) + from[3][c] * x) * y;
            };
            color.x[k] *= mixed(0), color.y[k] *= mixed(1), color.z[k] *= mixed(2);
        }
    }

    /* Phong's formula, of all lights. */
    V shaded(const Hit &hit, V d, int depth) const {
        I row = hit.material * COLUMNS;
        const float *table = scene.materials.data();
        V sum = {F{}, F{}, F{}},
          color = {gather<F>(table + RED, row), gather<F>(table + GREEN, row), gather<F>(table + BLUE, row)};
        if (scene.head.textures) paint(color, hit);
        F kd = gather<F>(table + KD, row), ks = gather<F>(table + KS, row), m = gather<F>(table + EXPONENT, row);
        for (const Light &light : scene.lights) {
            if (light.kind == AMBIENT) {
                V c = all<F>(light.color);
                sum = sum + V{c.x * color.x, c.y * color.y, c.z * color.z} * gather<F>(table + KA, row);
                continue;
            }
            F far = F{} + INFINITY, strength = F{} + 1;
            V start = hit.point + hit.normal * hit.off, l = all<F>(light.place);
            if (light.kind != PARALLEL) {
                l = l - start;
                far = root(dot(l, l));
                l = l * (1.f / far);
            }
            if (light.kind == SPOT) strength = cone(light, l);
            if (light.kind == LAMBERT) strength = most((F{} - 1) * dot(l, all<F>(light.axis)), F{});
            F cosine = dot(hit.normal, l);
            I lit = hit.there & (cosine > 0) & (strength > 0);
            if (!any(lit)) continue;
            lit = reached(lit, start, l, hit.off, far, depth);
            F along = most(dot(l - hit.normal * (2 * cosine), d), F{});
            F diffuse = choose(lit, kd * cosine * strength, F{});
            F lobe = choose(lit, ks * power(along, m) * strength, F{});
            V c = all<F>(light.color);
            sum = sum + V{c.x * (color.x * diffuse + lobe), c.y * (color.y * diffuse + lobe),
                          c.z * (color.z * diffuse + lobe)};
        }
        return sum;
    }

    static F cone(const Light &light, V l) {
        F cosine = (F{} - 1) * dot(l, all<F>(light.axis)), angle;
        for (int k = 0; k < N; k++) angle[k] = acosf(std::min(1.f, std::max(-1.f, cosine[k])));
        if (light.outer <= light.inner) return choose(angle <= light.outer, F{} + 1, F{});
        F share = (light.outer - angle) / (light.outer - light.inner);
        return choose(share > 1, F{} + 1, most(share, F{}));
    }

    I reached(I lit, V start, V l, F near, F far, int depth) const {
        alignas(64) typename Call::Ray shadow;
        alignas(64) I asked = lit;
        aim(shadow, start, l, near, far);
        RTCIntersectContext how = context(depth);
        Call::occluded((const int *)&asked, &how, shadow);
        return lit & (get<F>(shadow.tfar) >= 0);
    }

    /* The colours that rays see, times their weights. */
    V trace(Rays rays, int depth) const {
        V sum = {F{}, F{}, F{}};
        for (;; depth++) {
            Hit hit = closest(rays, depth);
            sum = sum + all<F>(scene.head.background) * choose(rays.live & ~hit.there, rays.weight, F{});
            if (!any(hit.there)) return sum;
            F weight = choose(hit.there, rays.weight, F{});
            const float *table = scene.materials.data();
            I row = hit.material * COLUMNS;
            F mirror = gather<F>(table + MIRROR, row), clear = gather<F>(table + CLEAR, row);
            bool last = depth > scene.head.bounces;
            F own = last ? F{} + 1 : most(1 - mirror - clear, F{});
            sum = sum + shaded(hit, rays.direction, depth) * (weight * own);
            if (last) return sum;
            F along = dot(rays.direction, hit.normal);
            I through = hit.there & (weight * clear > FAINT);
            if (any(through)) {
                F index = gather<F>(table + INDEX, row), eta = choose(hit.inside, index, 1 / index);
                F k = 1 - eta * eta * (1 - along * along);
                mirror = choose(through & (k < 0), mirror + clear, mirror);
                through = through & (k >= 0);
                V bent = rays.direction * eta - hit.normal * (eta * along + root(most(k, F{})));
                Rays further = {hit.point - hit.normal * hit.off, unit(bent), hit.off,
                                choose(through, weight * clear, F{}), through};
                if (any(through)) sum = sum + trace(further, depth + 1);
            }
            weight = weight * mirror;
            I live = hit.there & (weight > FAINT);
            if (!any(live)) return sum;
            V mirrored = unit(rays.direction - hit.normal * (2 * along));
            rays = {hit.point + hit.normal * hit.off, mirrored, hit.off, choose(live, weight, F{}), live};
        }
    }

    V sample(F x, F y, I live) const {
        const Head &head = scene.head;
        F u = (2 * x / (float)head.width - 1) * head.half_width;
        F v = (1 - 2 * y / (float)head.height) * head.half_height;
        Rays rays = {V{F{}, F{}, F{}}, unit(V{u, v, F{} - 1}), F{}, choose(live, F{} + 1, F{}), live};
        if (head.orthographic) rays.origin = V{u, v, F{}}, rays.direction = V{F{}, F{}, F{} - 1};
        return trace(rays, 0);
    }

    /* Pixels from x, y on, as many as there are lanes. */
    void pixels(int x, int y) const {
        const Head &head = scene.head;
        const int across = N == 1 ? 1 : LANES_ACROSS;
        F column, row;
        for (int k = 0; k < N; k++) column[k] = x + k % across, row[k] = y + k / across;
        I live = (column < (float)head.width) & (row < (float)head.height);
        V sum = {F{}, F{}, F{}};
        for (int i = 0; i < head.samples; i++)
            for (int j = 0; j < head.samples; j++) {
                V c = sample(column + (j + .5f) / head.samples, row + (i + .5f) / head.samples, live);
                auto clamped = [](F a) { return choose(a < 1, most(a, F{}), F{} + 1); };
                sum = sum + V{clamped(c.x), clamped(c.y), clamped(c.z)};
            }
        F scale = F{} + 255.f / (head.samples * head.samples);
        for (int k = 0; k < N; k++)
            if (live[k]) {
                unsigned char *out = &picture[3 * (size_t)((int)row[k] * head.width + (int)column[k])];
                out[0] = sum.x[k] * scale[k] + .5f, out[1] = sum.y[k] * scale[k] + .5f,
                out[2] = sum.z[k] * scale[k] + .5f;
            }
    }

    void frame() const {
        const Head &head = scene.head;
        const int across = (head.width + TILE - 1) / TILE, tiles = across * ((head.height + TILE - 1) / TILE);
        std::atomic<int> next{0};
        auto work = [&] {
            _mm_setcsr(_mm_getcsr() | 0x8040); // numbers too small for their exponent are 0, as Embree advises
            for (int tile; (tile = next++) < tiles;) {
                const int left = tile % across * TILE, top = tile / across * TILE;
                for (int y = top; y < std::min(top + TILE, head.height); y += N == 1 ? 1 : N / LANES_ACROSS)
                    for (int x = left; x < std::min(left + TILE, head.width); x += N == 1 ? 1 : LANES_ACROSS)
                        pixels(x, y);
            }
        };
        std::vector<std::thread> crew;
        for (unsigned k = 1; k < std::max(1u, std::thread::hardware_concurrency()); k++) crew.emplace_back(work);
        work();
        for (std::thread &each : crew) each.join();
    }
};

static double now() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

static double build(RTCDevice device, bool robust) {
    const Head &head = scene.head;
    double start = now();
    tree = rtcNewScene(device);
    auto add = [&](RTCGeometry shape, unsigned number) {
        rtcSetGeometryBuildQuality(shape, RTC_BUILD_QUALITY_HIGH);
        rtcCommitGeometry(shape);
        rtcAttachGeometryByID(tree, shape, number);
        rtcReleaseGeometry(shape);
    };
    if (head.spheres) {
        RTCGeometry balls = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_SPHERE_POINT);
        rtcSetSharedGeometryBuffer(balls, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, scene.spheres.data(), 0, 16,
                                   head.spheres);
        add(balls, 0);
    }
    if (head.triangles) {
        RTCGeometry mesh = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
        rtcSetSharedGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, scene.vertices.data(), 0, 12,
                                   head.vertices);
        rtcSetSharedGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, scene.corners.data(), 0, 12,
                                   head.triangles);
        add(mesh, 1);
    }
    ends.resize(head.cylinders);
    for (int k = 0; k < head.cylinders; k++) ends[k] = 2 * k;
    if (head.cylinders) {
        RTCGeometry rods = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_CONE_LINEAR_CURVE);
        rtcSetSharedGeometryBuffer(rods, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, scene.cylinders.data(), 0, 16,
                                   2ul * head.cylinders);
        rtcSetSharedGeometryBuffer(rods, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT, ends.data(), 0, 4, head.cylinders);
        add(rods, 2);
    }
    rtcSetSceneFlags(tree, robust ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE);
    rtcSetSceneBuildQuality(tree, RTC_BUILD_QUALITY_HIGH);
    rtcCommitScene(tree);
    return now() - start;
}

template <class T> static bool read(FILE *file, std::vector<T> &values, size_t count) {
    values.resize(count);
    return fread(values.data(), sizeof(T), count, file) == count;
}

static bool read_scene(const char *path) {
    FILE *file = fopen(path, "rb");
    Head &head = scene.head;
    if (!file || fread(&head, sizeof head, 1, file) != 1) return false;
    bool whole = read(file, scene.spheres, 4ul * head.spheres) && read(file, scene.vertices, 3ul * head.vertices) &&
                 read(file, scene.normals, 3ul * head.normals) && read(file, scene.corners, 3ul * head.triangles) &&
                 read(file, scene.normal_of, 3ul * head.triangles) && read(file, scene.uv, 6ul * head.triangles) &&
                 read(file, scene.cylinders, 8ul * head.cylinders) &&
                 read(file, scene.material_of, 0ul + head.spheres + head.triangles + head.cylinders) &&
                 read(file, scene.materials, 0ul + COLUMNS * head.materials) &&
                 read(file, scene.textures, 3ul * head.textures) && read(file, scene.texels, 3ul * head.texels) &&
                 read(file, scene.lights, head.lights);
    fclose(file);
    // Embree reads 16 bytes at a vertex.
    scene.vertices.resize(scene.vertices.size() + 1);
    float exponent = head.materials ? scene.materials[EXPONENT] : 0;
    for (int k = 0; k < head.materials; k++)
        if (scene.materials[k * COLUMNS + EXPONENT] != exponent) exponent = 0;
    scene.exponent = exponent == std::floor(exponent) && exponent < 4096 ? (int)exponent : 0;
    return whole;
}

int main(int count, char **words) {
    if (count == 1) return puts(RTC_VERSION_STRING) < 0;
    if (count < 4 || !read_scene(words[1])) {
        fprintf(stderr, "%s\n",
                count < 4 ? "usage: embree SCENE FRAMES PICTURE [ROBUST [WAY]]" : "the scene cannot be read");
        return 2;
    }
    const int frames = std::stoi(words[2]);
    const std::string robust = count > 4 ? words[4] : "", only = count > 5 ? words[5] : "";
    picture.resize(3ul * scene.head.width * scene.head.height);
    RTCDevice device = rtcNewDevice(nullptr);
    double built = build(device, robust == "1");
    const std::function<void()> ways[] = {[] { Tracer<LANES>{false}.frame(); }, [] { Tracer<LANES>{true}.frame(); },
                                          [] { Tracer<1>{false}.frame(); }};
    std::vector<double> best;
    int chosen = 0;
    for (int way = 0; way < 3; way++) {
        if (!only.empty() && only != std::to_string(way)) continue;
        std::vector<double> seconds;
        for (int k = 0; k < frames && (k == 0 || !only.empty() || seconds[0] < .1); k++) {
            double start = now();
            ways[way]();
            seconds.push_back(now() - start);
        }
        auto least = [](const std::vector<double> &s) { return *std::min_element(s.begin(), s.end()); };
        if (best.empty() || least(seconds) < least(best)) best = seconds, chosen = way;
    }
    FILE *file = fopen(words[3], "wb");
    if (!file || fwrite(picture.data(), 1, picture.size(), file) != picture.size() || fclose(file)) return 1;
    printf("{\"way\": %d, \"build\": %.9g, \"frames\": [", chosen, built);
    for (size_t k = 0; k < best.size(); k++) printf("%s%.9g", k ? ", " : "", best[k]);
    printf("]}\n");
}
