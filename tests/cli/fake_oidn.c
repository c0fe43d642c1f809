// Stands for Open Image Denoise in tests: the functions of version 2 that the program calls, and a "filter" whose result tells
// what it was given: colour / 2 + albedo / 4 + normal / 8 + quality.
#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    const char *first;
    size_t width, height, pixel_stride, row_stride;
} Image;

typedef struct {
    Image color, albedo, normal, output;
    bool hdr, committed;
    int quality;
} Filter;

static const char *error = NULL;
static int device;

static void fail(const char *message) {
    if (!error) error = message;
}

void *oidnNewDevice(int type) {
    if (type != 1) fail("not the processor");
    return &device;
}
void oidnCommitDevice(void *d) { (void)d; }
void oidnReleaseDevice(void *d) { (void)d; }
int oidnGetDeviceInt(void *d, const char *name) { return d && !strcmp(name, "versionMajor") ? 2 : 0; }

int oidnGetDeviceError(void *d, const char **message) {
    (void)d;
    *message = error;
    int code = error ? 1 : 0;
    error = NULL;
    return code;
}

void *oidnNewFilter(void *d, const char *type) {
    (void)d;
    if (strcmp(type, "RT")) fail("not a filter for path tracing");
    return calloc(1, sizeof(Filter));
}
void oidnReleaseFilter(void *filter) { free(filter); }

void oidnSetSharedFilterImage(void *filter, const char *name, void *first, int format, size_t width, size_t height,
                              size_t offset, size_t pixel_stride, size_t row_stride) {
    Filter *f = filter;
    Image image = {(char *)first + offset, width, height, pixel_stride, row_stride ? row_stride : width * pixel_stride};
    if (format != 3) fail("not three floats");
    if (!strcmp(name, "color")) f->color = image;
    else if (!strcmp(name, "albedo")) f->albedo = image;
    else if (!strcmp(name, "normal")) f->normal = image;
    else if (!strcmp(name, "output")) f->output = image;
    else fail("an unknown image");
}

void oidnSetFilterBool(void *filter, const char *name, bool value) {
    if (!strcmp(name, "hdr")) ((Filter *)filter)->hdr = value;
    else fail("an unknown switch");
}
void oidnSetFilterInt(void *filter, const char *name, int value) {
    if (!strcmp(name, "quality")) ((Filter *)filter)->quality = value;
    else fail("an unknown number");
}
void oidnCommitFilter(void *filter) { ((Filter *)filter)->committed = true; }

static float at(const Image *image, size_t x, size_t y, int c) {
    if (!image->first) return 0.0f;
    return ((const float *)(image->first + y * image->row_stride + x * image->pixel_stride))[c];
}

void oidnExecuteFilter(void *filter) {
    Filter *f = filter;
    if (getenv("FAKE_OIDN_FAILS")) return fail("the planted error");
    if (!f->committed || !f->hdr || !f->color.first || !f->output.first) return fail("not all is set");
    if (f->normal.first && !f->albedo.first) return fail("normals without albedo");
    for (size_t y = 0; y < f->output.height; y++)
        for (size_t x = 0; x < f->output.width; x++)
            for (int c = 0; c < 3; c++) {
                float *to = (float *)(f->output.first + y * f->output.row_stride + x * f->output.pixel_stride);
                to[c] = at(&f->color, x, y, c) / 2 + at(&f->albedo, x, y, c) / 4 + at(&f->normal, x, y, c) / 8 + f->quality;
            }
}
