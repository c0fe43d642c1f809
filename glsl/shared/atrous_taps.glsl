// The taps of one level of an A-Trous transform. A thread takes ROWS pixels of a column, push.spacing apart, because they share most
// of their taps; neighbouring threads have neighbouring columns, so that every level reads contiguous memory.
// Host: denoise::filter::atrous_taps.
const int ROWS = 4;

// First row of a thread; `column` counts the threads of one column of the image.
int first_row(int column, int spacing) {
    return column / spacing * (ROWS * spacing) + column % spacing;
}

// Weight of one of the five taps of the B3 spline filter (Murtagh 1998), `offset` from -2 to 2.
float b3_spline(int offset) {
    int by = abs(offset);
    return by == 0 ? 3.0 / 8.0 : by == 1 ? 1.0 / 4.0 : 1.0 / 16.0;
}
