// Sums over every window of WINDOW elements along a line, in time that hardly depends on it, and without ever subtracting:
// a window is the end of one group of elements and the beginning of a later one (van Herk 1992). Storing is what costs
// most on lavapipe, so that groups are short enough for a thread to keep, and whole ones lie between, each summed once
// and added to windows TILE at a time (the panes of Li, Maier, Tufte, Papadimos, Tucker 2005). Groups of TILE elements
// are counted from the first window's left border. Window j of tile k is the end of group k from its element j, GROUPS
// whole groups, and REST + j elements after those, whose sum becomes the next whole group on the way.
//
// Windows of 15 elements in tiles of 4, so that GROUPS = 2 and REST = 3. t: in `tail`, w: in a whole group, a: in `ahead`.
//
//     window 0   t t t t | w w w w | w w w w | a a a
//     window 1     t t t | w w w w | w w w w | a a a a
//     window 2       t t | w w w w | w w w w | a a a a | a
//     window 3         t | w w w w | w w w w | a a a a | a a
//
// tail[j] grows from the right to the left, and begins with the whole groups; `ahead` grows to the right by an element a window.
// As it fills its group it is kept as the newest whole one for the next tile, and the oldest is forgotten. A tile so adds fewer
// than 3 * TILE elements, however long windows are.
//
// A kernel defines SUM, its type, and NO_SUM, and the functions that are declared here.
layout(constant_id = 110) const int WINDOW = 49;
layout(constant_id = 111) const int TILE = 8;     // at most WINDOW
layout(constant_id = 112) const int SEGMENT = 64; // windows that a thread takes in turn

const int GROUPS = WINDOW > TILE ? (WINDOW - 1) / TILE - 1 : 0;
const int REST = WINDOW - (GROUPS + 1) * TILE;
const int SLOTS = GROUPS > 0 ? GROUPS : 1;

// Few groups are added one by one, out of registers. Many would make the code long and slow: they are added as two sums,
// of those that are left of the GROUPS when the turn began, and of those that came since. Not so for few: lavapipe reads
// an array lane by lane at a place that it does not know when it compiles, 1.35 of the whole time at radius 24.
const bool MANY = GROUPS > 8;
const int TURN = MANY ? GROUPS : 1; // tiles

// A sum of groups and the point that it is counted from.
struct Part {
    SUM sum;
    vec4 point;
};

// Few: the oldest first. Many: the one that leaves with tile `at` of the turn, with all after it, or, from that tile on,
// the one that came instead.
Part group[SLOTS];
Part recent; // sum of many that came in this turn

// The guide at a place on the line, or at the nearest pixel to it. Guides are counted from one that is within all windows
// that a sum is used for, so that far outliers cost no digits.
vec4 point_at(int line, int at);

// `sum`, counted from `point`, with an element, if there is one at that place.
void merge_element(inout SUM sum, vec4 point, int line, int at);

// Takes the sum over the window around a place.
void store(int line, int at, SUM whole, vec4 point);

void merge_part(inout SUM sum, vec4 point, Part part) {
    merge(sum, rebased(part.sum, point - part.point), true);
}

// For tile `at` of the turn.
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

// The oldest of the groups leaves, and `next` enters.
void append(Part next, int at) {
    if (MANY) {
        group[at] = next;
        merge_part(recent.sum, recent.point, next);
    } else {
        [[unroll]] for (int g = 0; g + 1 < SLOTS; g++) group[g] = group[g + 1];
        group[SLOTS - 1] = next;
    }
}

// Adds to every group all after it. `point`: what the next to come is counted from.
void begin_turn(vec4 point) {
    for (int g = GROUPS - 2; g >= 0; g--) {
        Part part = group[g];
        merge_part(part.sum, part.point, group[g + 1]);
        group[g] = part;
    }
    recent = Part(NO_SUM, point);
}

// Windows around `tile` to `end` - 1, no more than TILE, the first of which begins at `left`.
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
        int last = REST + j - 1; // of the window, from `next`
        if (last >= 0) merge_element(ahead.sum, ahead.point, line, next + last);
        if (last == TILE - 1) append(ahead, at);
        SUM whole = tail[j];
        merge_part(whole, here, ahead);
        if (tile + j < end) store(line, tile + j, whole, here);
    }
}

// Windows around `first` to `end` - 1.
void walk(int line, int first, int end) {
    int left = first - WINDOW / 2;
    // Groups are moved along before all have a value: without one, an NVIDIA H100 (driver 580.159) made wrong sums of three and more.
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
