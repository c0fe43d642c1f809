// Weight of one of the five taps of the B3 spline filter (Murtagh 1998), `offset` from -2 to 2.
float b3_spline(int offset) {
    int by = abs(offset);
    return by == 0 ? 3.0 / 8.0 : by == 1 ? 1.0 / 4.0 : 1.0 / 16.0;
}
