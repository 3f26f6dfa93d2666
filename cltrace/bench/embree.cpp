/* Draws a scene with Embree 3, as the benchmark's peer: spheres, triangles and cylinders (as its linear cones),
ambient, parallel, point and spot lights with shadows, Phong, mirrors and glass, in single precision.

    embree SCENE FRAMES PICTURE ROBUST WAY
    embree                                  (writes Embree's version)

SCENE is what peers.py writes: a Head, then the arrays of Scene, in camera space, in which the camera looks along -z.
ROBUST is 0 or 1, Embree's flag of that name. WAY is 0 or 1 for packets of as many rays as the processor has lanes, with
Embree's flag for coherent rays for the rays of the camera alone or for all of them, and 2 for single rays. Written to
stdout is one line of JSON: the seconds of building the tree, and of each frame. PICTURE gets the bytes of the pixels,
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
#include <cstdlib>
#include <cstring>
#include <numeric>
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
    int spheres, triangles, cylinders, materials, lights;
    float half_width, half_height; // of the image plane at distance 1, or of an orthographic picture
    float background[3];
    int unused; // arrays of four floats stand at multiples of 16 bytes
};
struct Light {
    int kind;
    float place[3], color[3], axis[3]; // place: of a parallel light the way to it, length 1; axis: along its light
    float inner, outer;                // radians from the axis
};
struct Scene {
    Head head;
    const float *spheres;            // x, y, z, radius
    const float *vertices, *normals; // x, y, z, of the three corners of each triangle
    const float *cylinders;          // x, y, z and radius of both ends
    const int *material_of;          // of spheres, of triangles, then of cylinders
    const float *materials;          // rows of COLUMNS
    const Light *lights;
};
constexpr int KA = 3, KD = 4, KS = 5, EXPONENT = 6, MIRROR = 7, CLEAR = 8, INDEX = 9;
constexpr int COLUMNS = 10;

static Scene scene;
static RTCScene tree;
static std::vector<unsigned> counting; // 0, 1, 2, ...
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
template <class F, class T, class I> static F gather(const T *from, I at) {
    F out;
    for (size_t k = 0; k < sizeof(I) / 4; k++) out[k] = from[at[k]];
    return out;
}
template <class F> static F power(F base, F exponent) {
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
template <class F, class I> static Vec<F> gather3(const float *from, I at) {
    return {gather<F>(from, at), gather<F>(from + 1, at), gather<F>(from + 2, at)};
}

/* Embree's calls, for one ray and for packets, whose structures are alike. on: the lanes that have a ray. */
template <int N> static void intersect(const int *on, RTCIntersectContext *context, RTCRayHitNt<N> &r) {
    if constexpr (N == 1) rtcIntersect1(tree, context, (RTCRayHit *)&r);
    else if constexpr (N == 8) rtcIntersect8(on, tree, context, (RTCRayHit8 *)&r);
    else rtcIntersect16(on, tree, context, (RTCRayHit16 *)&r);
}
template <int N> static void occluded(const int *on, RTCIntersectContext *context, RTCRayNt<N> &r) {
    if constexpr (N == 1) rtcOccluded1(tree, context, (RTCRay *)&r);
    else if constexpr (N == 8) rtcOccluded8(on, tree, context, (RTCRay8 *)&r);
    else rtcOccluded16(on, tree, context, (RTCRay16 *)&r);
}

template <int N> struct Tracer {
    typedef typename Wide<N>::F F;
    typedef typename Wide<N>::I I;
    typedef Vec<F> V;

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
    };

    RTCIntersectContext context(int depth) const {
        RTCIntersectContext made;
        rtcInitIntersectContext(&made);
        made.flags = depth == 0 || all_coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT
                                                : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
        return made;
    }

    static void aim(RTCRayNt<N> &ray, V o, V d, F near, F far) {
        put(ray.org_x, o.x), put(ray.org_y, o.y), put(ray.org_z, o.z);
        put(ray.dir_x, d.x), put(ray.dir_y, d.y), put(ray.dir_z, d.z);
        put(ray.tnear, near), put(ray.tfar, far), put(ray.time, F{});
        put(ray.mask, I{} - 1), put(ray.id, I{}), put(ray.flags, I{});
    }

    Hit closest(const Rays &rays, int depth) const {
        alignas(64) RTCRayHitNt<N> found;
        aim(found.ray, rays.origin, rays.direction, rays.near, F{} + INFINITY);
        put(found.hit.geomID, I{} - 1), put(found.hit.instID[0], I{} - 1);
        RTCIntersectContext how = context(depth);
        alignas(64) I live = rays.live;
        intersect<N>((const int *)&live, &how, found);
        Hit hit;
        I shape = get<I>(found.hit.geomID);
        hit.there = live & (shape != -1);
        I of_triangles = hit.there & (shape == 1), number = hit.there & get<I>(found.hit.primID);
        I first = (of_triangles & scene.head.spheres) +
                  (hit.there & (shape == 2) & (scene.head.spheres + scene.head.triangles));
        hit.material = gather<I>(scene.material_of, number + first);
        F t = choose(hit.there, get<F>(found.ray.tfar), F{} + 1);
        hit.point = rays.origin + rays.direction * t;
        V flat = {get<F>(found.hit.Ng_x), get<F>(found.hit.Ng_y), get<F>(found.hit.Ng_z)}, n = flat;
        if (any(of_triangles)) {
            F u = get<F>(found.hit.u), v = get<F>(found.hit.v);
            I at = of_triangles & (number * 9);
            V a = gather3<F>(scene.normals, at), b = gather3<F>(scene.normals + 3, at);
            n = choose(of_triangles, a * (1 - u - v) + b * u + gather3<F>(scene.normals + 6, at) * v, flat);
        }
        hit.inside = hit.there & (dot(flat, rays.direction) > 0);
        n = unit(choose(hit.there, n, V{F{}, F{}, F{} + 1}));
        hit.normal = choose(hit.inside, n * (F{} - 1), n);
        F size = root(dot(hit.point, hit.point)) + t;
        I of_spheres = hit.there & (shape == 0);
        if (any(of_spheres))
            size = size + choose(of_spheres, gather<F>(scene.spheres + 3, (number & of_spheres) * 4), F{});
        hit.off = size * OFF;
        return hit;
    }

    /* Phong's formula, of all lights. */
    V shaded(const Hit &hit, V d, int depth) const {
        I row = hit.material * COLUMNS;
        const float *table = scene.materials;
        V sum = {F{}, F{}, F{}}, color = gather3<F>(table, row);
        F kd = gather<F>(table + KD, row), ks = gather<F>(table + KS, row), m = gather<F>(table + EXPONENT, row);
        for (const Light *at = scene.lights; at < scene.lights + scene.head.lights; at++) {
            const Light &light = *at;
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
        alignas(64) RTCRayNt<N> shadow;
        alignas(64) I asked = lit;
        aim(shadow, start, l, near, far);
        RTCIntersectContext how = context(depth);
        occluded<N>((const int *)&asked, &how, shadow);
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
            const float *table = scene.materials;
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
    // Triangles have corners of their own, and cylinders ends, so indices are those of all vertices, in their order.
    counting.resize(std::max(3ul * head.triangles, 2ul * head.cylinders));
    std::iota(counting.begin(), counting.end(), 0u);
    auto add = [&](RTCGeometryType type, unsigned number, size_t count, RTCFormat format, size_t size,
                   const float *from, size_t vertices, RTCFormat index, size_t step) {
        if (!count) return;
        RTCGeometry shape = rtcNewGeometry(device, type);
        rtcSetSharedGeometryBuffer(shape, RTC_BUFFER_TYPE_VERTEX, 0, format, from, 0, size, vertices);
        if (step) rtcSetSharedGeometryBuffer(shape, RTC_BUFFER_TYPE_INDEX, 0, index, counting.data(), 0, step, count);
        rtcSetGeometryBuildQuality(shape, RTC_BUILD_QUALITY_HIGH);
        rtcCommitGeometry(shape);
        rtcAttachGeometryByID(tree, shape, number);
        rtcReleaseGeometry(shape);
    };
    add(RTC_GEOMETRY_TYPE_SPHERE_POINT, 0, head.spheres, RTC_FORMAT_FLOAT4, 16, scene.spheres, head.spheres,
        RTC_FORMAT_UINT, 0);
    add(RTC_GEOMETRY_TYPE_TRIANGLE, 1, head.triangles, RTC_FORMAT_FLOAT3, 12, scene.vertices, 3ul * head.triangles,
        RTC_FORMAT_UINT3, 12);
    add(RTC_GEOMETRY_TYPE_CONE_LINEAR_CURVE, 2, head.cylinders, RTC_FORMAT_FLOAT4, 16, scene.cylinders,
        2ul * head.cylinders, RTC_FORMAT_UINT, 8);
    rtcSetSceneFlags(tree, robust ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE);
    rtcSetSceneBuildQuality(tree, RTC_BUILD_QUALITY_HIGH);
    rtcCommitScene(tree);
    return now() - start;
}

/* The file's bytes, to which the scene points; false if there are not as many as its head says. */
static bool read_scene(const char *path) {
    static std::vector<char> bytes;
    FILE *file = fopen(path, "rb");
    char block[1 << 16];
    for (size_t n; file && (n = fread(block, 1, sizeof block, file)) > 0;) bytes.insert(bytes.end(), block, block + n);
    if (!file || fclose(file) || bytes.size() < sizeof(Head)) return false;
    const size_t size = bytes.size();
    bytes.resize(size + 16); // Embree reads 16 bytes at a vertex
    const Head &head = scene.head = *(const Head *)bytes.data();
    const char *at = bytes.data() + sizeof head;
    auto take = [&](auto *&array, size_t count) {
        array = (decltype(array + 0))at;
        at += sizeof *array * count;
    };
    take(scene.spheres, 4ul * head.spheres), take(scene.cylinders, 8ul * head.cylinders);
    take(scene.vertices, 9ul * head.triangles), take(scene.normals, 9ul * head.triangles);
    take(scene.material_of, 0ul + head.spheres + head.triangles + head.cylinders);
    take(scene.materials, 0ul + COLUMNS * head.materials), take(scene.lights, head.lights);
    return at == bytes.data() + size;
}

int main(int count, char **words) {
    if (count == 1) return puts(RTC_VERSION_STRING) < 0;
    if (count != 6 || !read_scene(words[1])) return fprintf(stderr, "the scene cannot be read\n"), 2;
    picture.resize(3ul * scene.head.width * scene.head.height);
    const int way = atoi(words[5]);
    printf("{\"build\": %.9g, \"frames\": [", build(rtcNewDevice(nullptr), atoi(words[4])));
    for (int k = 0, frames = atoi(words[2]); k < frames; k++) {
        double start = now();
        if (way == 2) Tracer<1>{false}.frame();
        else Tracer<LANES>{way == 1}.frame();
        printf("%s%.9g", k ? ", " : "", now() - start);
    }
    puts("]}");
    FILE *file = fopen(words[3], "wb");
    return !file || fwrite(picture.data(), 1, picture.size(), file) != picture.size() || fclose(file);
}
