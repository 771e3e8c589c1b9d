// How many bricks there are of each level, and which levels have room. Expects the texel buffer `counters`.

// Bricks of one level in the order of their numbers; they begin at `first` in the pool.
struct Level {
    int first, count;
};
Level bricks_of_level[vxao_levels];
int finest; // level that there is room for
int bricks; // in all, of the levels from there on

void number_levels(VxaoConstants c) {
    int first = 0;
    finest = c.levels;
    bool fits = true;
    for (int level = vxao_levels - 1; level >= 0; --level) {
        int count = level < c.levels ? int(imageLoad(counters, level).x) : 0;
        fits = fits && first + count <= c.bricks;
        bricks_of_level[level] = Level(first, fits ? count : 0);
        first += fits ? count : 0;
        finest = fits && level < c.levels ? level : finest;
    }
    bricks = first;
}

int level_of(int brick) {
    int level = finest;
    while (level < vxao_levels - 1 && brick < bricks_of_level[level].first) ++level;
    return level;
}
