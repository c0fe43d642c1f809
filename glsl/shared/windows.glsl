// Sums over every window of WINDOW elements along a line, in a time that hardly depends on WINDOW, and without subtraction. The
// elements are cut into groups of TILE, counted from the first window's left border. A window consists of the end of one group,
// GROUPS whole groups, and the beginning of a later one (van Herk 1992). A whole group is summed once and added to TILE windows
// (the panes of Li, Maier, Tufte, Papadimos, Tucker 2005). TILE is small, so that a thread keeps a group in registers: storing
// costs most on lavapipe. Window j of tile k is the end of group k from its element j, GROUPS whole groups, and REST + j elements
// after those, whose sum becomes the next whole group.
//
// The figure shows windows of 15 elements in tiles of 4, so that GROUPS = 2 and REST = 3. An element marked t is in `tail`, w in
// a whole group, a in `ahead`.
//
//     window 0   t t t t | w w w w | w w w w | a a a
//     window 1     t t t | w w w w | w w w w | a a a a
//     window 2       t t | w w w w | w w w w | a a a a | a
//     window 3         t | w w w w | w w w w | a a a a | a a
//
// `tail` starts with the whole groups and grows from right to left; `ahead` grows to the right by one element per window. Once it
// fills its group, it becomes the newest whole group for the next tile, and the oldest is dropped. So a tile adds fewer than
// 3 * TILE elements, however long windows are.
//
// The including kernel defines SUM, the type of sums, its zero NO_SUM, and the functions that are declared here.
layout(constant_id = 110) const int WINDOW = 49;
layout(constant_id = 111) const int TILE = 8;     // at most WINDOW
layout(constant_id = 112) const int AT_ONCE = 0;  // windows that a thread takes together, at most WINDOW; 0: it takes more, tile by tile

const int GROUPS = WINDOW > TILE ? (WINDOW - 1) / TILE - 1 : 0;
const int REST = WINDOW - (GROUPS + 1) * TILE;
const int SLOTS = GROUPS > 0 ? GROUPS : 1;

// Up to 8 groups are added one by one, out of registers. More would make the code long and slow: they are added as two sums, one
// of the groups that remain from the beginning of the turn, and one of those that came since. For few groups that would be
// slower (1.35 of the whole time at radius 24): lavapipe reads an array at an index unknown to the compiler lane by lane.
const bool MANY = GROUPS > 8;
const int TURN = MANY ? GROUPS : 1; // length of a turn in tiles

const int AT_A_TIME = AT_ONCE > 0 ? AT_ONCE : 1;

// A sum of groups, and the point that its guides are relative to.
struct Part {
    SUM sum;
    vec4 point;
};

// Few groups: the oldest first. Many: group[at] is the sum of the group that is dropped with tile `at` of the turn and of all
// after it; from that tile on, it is the group that came in its place.
Part group[SLOTS];
Part recent; // with many groups, the sum of those that came in this turn

// The guide at a position on the line, or at the pixel nearest to it. Guides of a sum are relative to one that lies within all
// windows which use the sum, so that outliers elsewhere cost no digits.
vec4 point_at(int line, int at);

// Adds the element at a position, if there is one, to `sum`, whose guides are relative to `point`.
void merge_element(inout SUM sum, vec4 point, int line, int at);

// Receives the sum over the window around a position.
void store(int line, int at, SUM whole, vec4 point);

void merge_part(inout SUM sum, vec4 point, Part part) {
    merge(sum, rebased(part.sum, point - part.point), true);
}

// Sum of the whole groups of tile `at` of the turn.
SUM whole_groups(vec4 point, int at) {
    SUM sum = NO_SUM;
    if (MANY) {
        merge_part(sum, point, group[at]);
        merge_part(sum, point, recent);
    } else {
        [[unroll]] for (int g = 0; g < GROUPS; g++) merge_part(sum, point, group[g]);
    }
    return sum;
}

// Drops the oldest group and adds `next`.
void append(Part next, int at) {
    if (MANY) {
        group[at] = next;
        merge_part(recent.sum, recent.point, next);
    } else {
        [[unroll]] for (int g = 0; g + 1 < SLOTS; g++) group[g] = group[g + 1];
        group[SLOTS - 1] = next;
    }
}

// Begins a turn of many groups: adds to every group all groups after it. `point` is that of the next group.
void begin_turn(vec4 point) {
    for (int g = GROUPS - 2; g >= 0; g--) {
        Part part = group[g];
        merge_part(part.sum, part.point, group[g + 1]);
        group[g] = part;
    }
    recent = Part(NO_SUM, point);
}

// Stores the windows around `tile` to `end` - 1, at most TILE; the first one begins at `left`.
void walk_tile(int line, int tile, int end, int left, int at) {
    vec4 here = point_at(line, min(tile + TILE / 2, end - 1));
    SUM sum = whole_groups(here, at), tail[TILE];
    [[unroll]] for (int j = TILE - 1; j >= 0; j--) {
        merge_element(sum, here, line, left + j);
        tail[j] = sum;
    }
    int next = left + (GROUPS + 1) * TILE;
    Part ahead = Part(NO_SUM, point_at(line, next));
    [[unroll]] for (int i = 0; i < REST - 1; i++) merge_element(ahead.sum, ahead.point, line, next + i);
    [[unroll]] for (int j = 0; j < TILE; j++) {
        int last = REST + j - 1; // last element of the window, from `next`
        if (last >= 0) merge_element(ahead.sum, ahead.point, line, next + last);
        if (last == TILE - 1) append(ahead, at);
        SUM whole = tail[j];
        merge_part(whole, here, ahead);
        if (tile + j < end) store(line, tile + j, whole, here);
    }
}

// Stores the windows around `first` to `end` - 1, at most AT_ONCE; the first one begins at `left`. What all of them hold is summed
// once, element by element. That is for a GPU, which needs many threads with few registers each.
void take_at_once(int line, int first, int end, int left) {
    vec4 here = point_at(line, min(first + AT_A_TIME / 2, end - 1));
    SUM sum = NO_SUM, tail[AT_A_TIME];
    for (int i = AT_A_TIME - 1; i < WINDOW; i++) merge_element(sum, here, line, left + i);
    [[unroll]] for (int j = AT_A_TIME - 1; j >= 0; j--) {
        tail[j] = sum;
        if (j > 0) merge_element(sum, here, line, left + j - 1);
    }
    SUM ahead = NO_SUM;
    [[unroll]] for (int j = 0; j < AT_A_TIME; j++) {
        if (j > 0) {
            merge_element(ahead, here, line, left + WINDOW + j - 1);
            merge(tail[j], ahead, true);
        }
        if (first + j < end) store(line, first + j, tail[j], here);
    }
}

// Stores the thread's share of the `count` windows of a line, the first of which is around `origin`.
void walk(int line, int origin, int count) {
    int threads = int(gl_NumWorkGroups.y), share = AT_ONCE > 0 ? AT_ONCE : (count + threads - 1) / threads;
    int first = origin + int(gl_GlobalInvocationID.y) * share, end = min(first + share, origin + count);
    if (first >= end) return;
    int left = first - WINDOW / 2;
    if (AT_ONCE > 0) {
        take_at_once(line, first, end, left);
        return;
    }
    // `append` moves groups before all have a value. Without initial values an NVIDIA H100 (driver 580.159) computed wrong sums of
    // three and more groups.
    if (!MANY) {
        [[unroll]] for (int g = 0; g < SLOTS; g++) group[g] = Part(NO_SUM, vec4(0.0));
    }
    for (int g = 0; g < GROUPS; g++) {
        int begin = left + (g + 1) * TILE;
        Part part = Part(NO_SUM, point_at(line, begin));
        for (int i = 0; i < TILE; i++) merge_element(part.sum, part.point, line, begin + i);
        append(part, g);
    }
    // Tested at its end: see shared/traverse.glsl.
    int tile = first, at = 0;
    do {
        if (MANY && at == 0) begin_turn(point_at(line, left + (GROUPS + 1) * TILE));
        walk_tile(line, tile, end, left, at);
        at = (at + 1) % TURN;
        left += TILE;
        tile += TILE;
    } while (tile < end);
}
