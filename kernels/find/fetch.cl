/* fetch.cl: surfaces are fetched before they are asked. With many of them, what is read of neighbours in a list is far
 * apart in memory, and most of the time went into waiting for it. Each shape's part is in fetch.cl of its folder. */
#define FETCHES (HAS(WITH_PREFETCH) && CAN_FETCH)

/* Fetches what an entry of a list will ask for. light: whose list it is, -1: of the eye. */
static void fetch_entry(const Scene *scene, const int light, const int k) {
    if (!FETCHES) return;
    const int index = scene->lists.entry[k].x;
    ASK_SHAPE(scene->spheres, index, fetch(scene, light, index));
}

/* The same for the first entries of a list. */
static void fetch_ahead(const Scene *scene, const int light, const int first) {
    for (int k = first; FETCHES && k < first + AHEAD; k++) fetch_entry(scene, light, k);
}

/* The same for the lists of all lanes' cells in a light's buffer. Points of different surfaces have lists that are far
 * apart, and what has to be waited for is there in three steps: where a list begins, its first entry, that surface's
 * filter. Few of the cells are different ones. */
static void fetch_lists(const Scene *scene, const int light, INT cell) {
    const int pays = FETCHES & (ANY_FETCHED | HAS(WITH_BOUNCES));
    if (!pays) return;
    int each[W], count = 0;
    for (int c = LARGEST(cell); c >= 0; c = LARGEST(cell)) {
        FETCH(scene->lists.start, c);
        each[count++] = c;
        cell = cell == c ? (INT)-1 : cell;
    }
    for (int k = 0; k < count; k++) FETCH(scene->lists.entry, scene->lists.start[each[k]]);
    for (int k = 0; k < count; k++) {
        const int index = scene->lists.entry[scene->lists.start[each[k]]].x;
        ASK_SHAPE(scene->spheres, index, fetch_first(scene, light, index));
    }
}
