// The B3 spline as a filter of five taps (Murtagh 1998), by their places from the centre.
float b3_spline(int offset) {
    int by = abs(offset);
    return by == 0 ? 3.0 / 8.0 : by == 1 ? 1.0 / 4.0 : 1.0 / 16.0;
}
