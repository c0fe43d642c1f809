// Tables of what rough interfaces reflect, by roughness and cosine: see COAT_ROWS. Twin: src/twins/coat.rs.
// Needs the binding `texels`, which holds them.
#include "shared/texel_word.glsl"

// The entries around a place in a table, in the order (row, column), (row, column + 1), (row + 1, column), (row + 1, column + 1),
// and how far the place is from the first: x along columns, y along rows.
struct TableCell {
    uvec4 words;
    vec2 within;
};

float table_row(float alpha) {
    return (log2(max(alpha, SMOOTH_ALPHA)) * (1.0 / 6.643856189774724) + 1.0) * float(COAT_ROWS - 1u);
}

float table_column(float cosine) {
    return sqrt(clamp(cosine, 0.0, 1.0)) * float(COAT_COLUMNS - 2u);
}

TableCell table_cell(uint table, float row, float column) {
    int i = min(int(row), int(COAT_ROWS) - 2), j = min(int(column), int(COAT_COLUMNS) - 2);
    uint at = table + uint(i) * COAT_COLUMNS + uint(j), below = at + COAT_COLUMNS;
    uvec4 words = uvec4(texel_word(at), texel_word(at + 1u), texel_word(below), texel_word(below + 1u));
    return TableCell(words, vec2(column - float(j), row - float(i)));
}
