// Sums over every window of WINDOW elements along a line, in time that hardly depends on it, and without ever subtracting:
// a window is the end of one group of elements and the beginning of a later one (van Herk 1992). Storing is what costs
// most on lavapipe, so that groups are short enough for a thread to keep, and whole ones lie between, each summed once
// and added to windows TILE at a time (the panes of Li, Maier, Tufte, Papadimos, Tucker 2005). Groups of TILE elements
// are counted from the first window's left border. Window j of tile k is the end of group k from its element j, GROUPS
// whole groups, and REST + j elements after those, whose sum becomes the next whole group on the way.
//
// A kernel defines SUM, its type, and NO_SUM, and the functions that are declared here.
layout(constant_id = 110) const int WINDOW = 49;
layout(constant_id = 111) const int TILE = 8;     // at most WINDOW
layout(constant_id = 112) const int SEGMENT = 64; // windows that a thread takes in turn

const int GROUPS = WINDOW > TILE ? (WINDOW - 1) / TILE - 1 : 0;
const int REST = WINDOW - (GROUPS + 1) * TILE;
const int SLOTS = GROUPS > 0 ? GROUPS : 1;

// The guide at a place on the line, or at the nearest pixel to it. Guides are counted from one that is within all windows
// that a sum is used for, so that far outliers cost no digits.
vec4 point_at(int line, int at);

// `sum`, counted from `point`, with an element, if there is one at that place.
void absorb_element(inout SUM sum, vec4 point, int line, int at);

// Takes the sum over the window around a place.
void put(int line, int at, SUM whole, vec4 point);

// The oldest of the whole groups leaves, and `sum` enters.
void append(inout SUM group[SLOTS], inout vec4 origin[SLOTS], SUM sum, vec4 begin) {
    [[unroll]] for (int g = 0; g + 1 < SLOTS; g++) {
        group[g] = group[g + 1];
        origin[g] = origin[g + 1];
    }
    group[SLOTS - 1] = sum;
    origin[SLOTS - 1] = begin;
}

// Windows around `first` to `end` - 1.
void walk(int line, int first, int end) {
    SUM group[SLOTS];
    vec4 origin[SLOTS]; // what each is counted from
    int left = first - WINDOW / 2;
    [[unroll]] for (int g = 0; g < SLOTS; g++) {
        group[g] = NO_SUM;
        origin[g] = vec4(0.0);
    }
    for (int g = 1; g <= GROUPS; g++) {
        vec4 begin = point_at(line, left + g * TILE);
        SUM sum = NO_SUM;
        for (int i = 0; i < TILE; i++) absorb_element(sum, begin, line, left + g * TILE + i);
        append(group, origin, sum, begin);
    }
    for (int tile = first; tile < end; tile += TILE, left += TILE) {
        vec4 here = point_at(line, min(tile + TILE / 2, end - 1));
        SUM sum = NO_SUM, tail[TILE];
        [[unroll]] for (int g = 0; g < GROUPS; g++) absorb(sum, moved(group[g], here - origin[g]), 1.0);
        [[unroll]] for (int j = TILE - 1; j >= 0; j--) {
            absorb_element(sum, here, line, left + j);
            tail[j] = sum;
        }
        int next = left + (GROUPS + 1) * TILE;
        vec4 begin = point_at(line, next);
        sum = NO_SUM;
        [[unroll]] for (int i = 0; i < REST - 1; i++) absorb_element(sum, begin, line, next + i);
        [[unroll]] for (int j = 0; j < TILE; j++) {
            int ahead = REST + j - 1; // the last element of the window
            if (ahead >= 0) absorb_element(sum, begin, line, next + ahead);
            if (ahead == TILE - 1) append(group, origin, sum, begin);
            SUM whole = tail[j];
            absorb(whole, moved(sum, here - begin), 1.0);
            if (tile + j < end) put(line, tile + j, whole, here);
        }
    }
}
