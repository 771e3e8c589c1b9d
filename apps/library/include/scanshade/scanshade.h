/* scanshade's C interface: depth images, clouds and captures in, ambient occlusion out. The C++ headers beside it and
 * the Python module are made of these functions, and so can be bindings for other languages.
 *
 * CONVENTIONS
 *   axes        camera space is x right, y down, z forward; metres
 *   depth       z along the optical axis, not the range along the ray; 0 = hole
 *   pixels      integer coordinates are pixel centres
 *   poses       world_from_camera, camera to world, 4x4, row by row; metres
 *   visibility  1 = open, 0 = closed, NaN = no surface; float, row by row
 *
 * ERRORS
 *   A function that can fail returns a status. scanshade_last_error() then has the sentence, with the value given and
 *   what was expected. No C++ exception leaves the library. Output handles are set to NULL on failure.
 *
 * HANDLES
 *   Each *_free or *_close function takes NULL, too. A NULL handle elsewhere is SCANSHADE_MISUSE, or NULL, or 0.
 *
 * TEXT
 *   UTF-8. Returned text belongs to the handle and lives as long as it, unless stated otherwise.
 *
 * STRUCTS
 *   `size` is sizeof the struct as the caller was compiled; the SCANSHADE_*_INIT macros set it. Later versions append
 *   members; those that a caller does not know keep their defaults (zero).
 *
 * THREADS
 *   All functions may be called from several threads at once, on the same handle, too. Only *_free and *_close must be
 *   the last call of a handle. A session computes as many images at once as its setting `in-flight` says; further calls
 *   wait. */
#ifndef SCANSHADE_SCANSHADE_H
#define SCANSHADE_SCANSHADE_H

#include <stddef.h>
#include <stdint.h>

#if defined(__GNUC__)
#define SCANSHADE_API __attribute__((visibility("default")))
#else
#define SCANSHADE_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

typedef enum scanshade_status {
    SCANSHADE_OK = 0,
    SCANSHADE_MISUSE = 1,    /* a setting or an argument is impossible */
    SCANSHADE_BAD_INPUT = 2, /* a file, an image or a cloud is; trying again will not help */
    SCANSHADE_OUTAGE = 4, /* device lost, memory or disk full, share gone; a later try, or a new process, may succeed */
    SCANSHADE_INTERNAL = 5 /* an error in the library */
} scanshade_status;

/* "0.1.0". Lives for ever. */
SCANSHADE_API const char* scanshade_version(void);

/* Why the last failed call of this thread failed; "" before any. Lives until the thread's next failure. Texts are kept
 * by thread, not by handle, since several threads may use one handle. */
SCANSHADE_API const char* scanshade_last_error(void);

/* ------------------------------------------------------------------------------------------------------ settings */

/* A setting as the program's command line takes it, without the dashes: {"method", "surfel"}, {"radius", "0.5"},
 * {"surfel.downsampled", "true"}. */
typedef struct scanshade_setting {
    const char* name;
    const char* value;
} scanshade_setting;

/* A JSON array of all settings: {"for": "session" | "capture" | "refine" | "relief", "stage", "name", "help",
 * "default", "unit", "low", "high", "choices"}. Lives for ever. */
SCANSHADE_API const char* scanshade_settings(void);

/* A JSON array of the Vulkan devices: {"index", "name", "kind", "driver", "api", "unusable"}. The text lives until the
 * next call of this thread. NULL on failure. */
SCANSHADE_API const char* scanshade_devices(void);

/* ------------------------------------------------------------------------------------------------------ sessions */

/* Settings, devices, and the compiled pipelines of a method. Making one checks the settings; the device is opened, and
 * its pipelines are compiled, when first needed. Sessions of one device share it. */
typedef struct scanshade_session scanshade_session;

/* MISUSE for a setting that is unknown or out of range. */
SCANSHADE_API scanshade_status scanshade_session_open(const scanshade_setting* settings, size_t count,
                                                      scanshade_session** session);
SCANSHADE_API void scanshade_session_close(scanshade_session* session);

/* All settings that shape its results, as used: a JSON object of names and values. */
SCANSHADE_API const char* scanshade_session_settings(const scanshade_session* session);

/* ------------------------------------------------------------------------------------------------------ input */

typedef enum scanshade_lens {
    SCANSHADE_BROWN = 0,   /* k1, k2, p1, p2, k3 (Brown 1966, as in OpenCV); all zero = none */
    SCANSHADE_FISHEYE = 1, /* k1, k2, k3, k4 (Kannala and Brandt 2006; OpenCV's fisheye) */
    SCANSHADE_RATIONAL = 2 /* SCANSHADE_BROWN with k4, k5, k6 in `denominator` (OpenCV's 8 numbers; Azure Kinect) */
} scanshade_lens;

/* A camera, in pixels. */
typedef struct scanshade_camera {
    size_t size;
    double fx, fy, cx, cy;
    int32_t width, height; /* 0 = those of the depth image */
    int32_t lens;          /* scanshade_lens */
    double distortion[5];
    double denominator[3]; /* of SCANSHADE_RATIONAL */
} scanshade_camera;
#define SCANSHADE_CAMERA_INIT                                                                                          \
    {                                                                                                                  \
        sizeof(scanshade_camera), 0, 0, 0, 0, 0, 0, 0, {0, 0, 0, 0, 0}, { 0, 0, 0 }                                    \
    }

typedef enum scanshade_type { SCANSHADE_UINT16 = 1, SCANSHADE_FLOAT32 = 2, SCANSHADE_FLOAT64 = 3 } scanshade_type;

/* Depth images of one camera. They are only read, and not after the call. */
typedef struct scanshade_depth {
    size_t size;
    const void* values;      /* UINT16 (0 and 65535 = hole) or FLOAT32 (0, negative and not finite = hole) */
    int32_t type;            /* scanshade_type */
    int32_t width, height;   /* pixels */
    int64_t count;           /* images */
    int64_t row_bytes;       /* from one row to the next; 0 = rows are packed */
    int64_t image_bytes;     /* from one image to the next; 0 = images are packed */
    const char* depth_scale; /* "mm", "tum", "sun", "nyu", "m" or units per metre, as the program's --depth-scale; NULL
                                = millimetres for UINT16, metres for FLOAT32 */
    const scanshade_camera* camera;
    const double* world_from_camera; /* count matrices of 4x4, or NULL. A pose with a NaN is none. The setting
                                        `sequence` needs them */
} scanshade_depth;
#define SCANSHADE_DEPTH_INIT                                                                                           \
    { sizeof(scanshade_depth), NULL, 0, 0, 0, 1, 0, 0, NULL, NULL, NULL }

/* A cloud, or a mesh where there are triangles, in metres or any unit of its own. Only read, and not after the call. */
typedef struct scanshade_points {
    size_t size;
    const void* points;       /* count times x, y, z; those that are not finite are left out */
    int32_t points_type;      /* FLOAT32 or FLOAT64 */
    int64_t count;            /* points */
    int64_t points_bytes;     /* from one point to the next; 0 = packed */
    const void* normals;      /* unit normals, or NULL: then they are estimated */
    int32_t normals_type;     /* FLOAT32 or FLOAT64 */
    int64_t normals_bytes;    /* from one normal to the next; 0 = packed */
    const int32_t* triangles; /* triangle_count times three indices of points, or NULL */
    int64_t triangle_count;
    const double* scanner; /* x, y, z of where the cloud was seen from, or NULL */
    int32_t z_up;          /* 1 = z is known to point to the sky */
} scanshade_points;
#define SCANSHADE_POINTS_INIT                                                                                          \
    { sizeof(scanshade_points), NULL, SCANSHADE_FLOAT32, 0, 0, NULL, SCANSHADE_FLOAT32, 0, NULL, 0, NULL, 0 }

/* ------------------------------------------------------------------------------------------------------ results */

/* What to compute besides visibility; flags to be added. */
enum { SCANSHADE_VISIBILITY = 0, SCANSHADE_CONFIDENCE = 1, SCANSHADE_NORMALS = 2 };

typedef struct scanshade_result scanshade_result;

/* Arrays of a result, packed; they live as long as it. Images: count x height x width. Points: 1 x height x width, in
 * their order: 1 x 1 x n, or the grid of an organised cloud. */
typedef struct scanshade_arrays {
    size_t size;
    int64_t count, height, width;
    const float* visibility; /* 0 .. 1, NaN = no surface */
    const float* confidence; /* 0 .. 1, how far each value can be believed: 1 - expected error / 0.3, of images as of
                                points; NaN like visibility, of points 0; NULL = not asked for */
    const float* normals; /* x, y, z of each, unit length, of depth in camera space; NaN = none; NULL = not asked for,
                             or a mesh */
} scanshade_arrays;
#define SCANSHADE_ARRAYS_INIT                                                                                          \
    { sizeof(scanshade_arrays), 0, 0, 0, NULL, NULL, NULL }

/* Ambient occlusion of depth images, each by itself; with the setting `sequence` and poses, together. The noise of the
 * depth is measured on up to five of the images unless the setting `depth-noise` says it. Without the setting `radius`,
 * a scene too small for the usual one gets a smaller one. BAD_INPUT names the image. */
SCANSHADE_API scanshade_status scanshade_compute_depth(scanshade_session* session, const scanshade_depth* depth,
                                                       uint32_t outputs, scanshade_result** result);
/* Of every point, by rays from it, without a camera. `sky` and `radius` of clouds are the settings cloud.sky and
 * cloud.radius. */
SCANSHADE_API scanshade_status scanshade_compute_points(scanshade_session* session, const scanshade_points* points,
                                                        uint32_t outputs, scanshade_result** result);

SCANSHADE_API scanshade_status scanshade_result_arrays(const scanshade_result* result, scanshade_arrays* arrays);
/* A JSON object: "settings" as used, "device", "depth_noise", "radius" (that of small scenes is smaller than the
 * setting), "warnings" about all images together, and "frames", a list with "name", "notes", "warnings", "doubts" (why
 * the values may be wrong), "coverage", "mean_visibility", "expected_error" (RMS; null = unknown) and "ms" for each. */
SCANSHADE_API const char* scanshade_result_info(const scanshade_result* result);
/* The doubt of that number about image `image`; NULL past the last. */
SCANSHADE_API const char* scanshade_result_doubt(const scanshade_result* result, int64_t image, int64_t number);
SCANSHADE_API void scanshade_result_free(scanshade_result* result);

/* ------------------------------------------------------------------------------------------------------ captures */

/* A recording, listed: a folder, a depth image or a cloud file, in any of the program's formats. */
typedef struct scanshade_capture scanshade_capture;
/* One frame of it, decoded. */
typedef struct scanshade_frame scanshade_frame;

/* Opening lists the frames and decodes none. Settings: camera, depth-scale, poses, colour, association-limit,
   topic, confidence-min. A recording in an arbitrary unit (COLMAP) is refused without depth-scale, since lengths here
   are metres. */
SCANSHADE_API scanshade_status scanshade_capture_open(const char* path, const scanshade_setting* settings, size_t count,
                                                      scanshade_capture** capture);
SCANSHADE_API void scanshade_capture_close(scanshade_capture* capture);
SCANSHADE_API int64_t scanshade_capture_count(const scanshade_capture* capture);
/* A JSON object: path, kind, camera, depth_scale, registered, warnings, and frames: name and, where known, stamp_s. */
SCANSHADE_API const char* scanshade_capture_info(const scanshade_capture* capture);
/* Decodes frame `index`, from 0. It may outlive the capture's handle. */
SCANSHADE_API scanshade_status scanshade_capture_load(scanshade_capture* capture, int64_t index,
                                                      scanshade_frame** frame);

/* What a frame holds; pointers live as long as it. Either depth_m or points is there. */
typedef struct scanshade_frame_data {
    size_t size;
    const char* name;
    int32_t width, height; /* of depth_m, or the grid of the points: n x 1 for unorganised clouds */
    const float* depth_m;  /* metres, 0 = hole, packed; NULL for clouds */
    const double* points;  /* x, y, z of each, NaN = invalid; NULL for depth images */
    int32_t colour_width, colour_height;
    const uint8_t* colour;           /* blue, green, red, packed: an image, or one per point; NULL = none */
    int32_t colour_registered;       /* 1 = colour pixels lie on depth pixels, 0 = they do not, -1 = unknown */
    const scanshade_camera* camera;  /* of the depth image or the grid; NULL = none is known */
    const double* world_from_camera; /* 4x4; NULL = none */
} scanshade_frame_data;
#define SCANSHADE_FRAME_DATA_INIT                                                                                      \
    { sizeof(scanshade_frame_data), NULL, 0, 0, NULL, NULL, 0, 0, NULL, -1, NULL, NULL }

SCANSHADE_API scanshade_status scanshade_frame_get(const scanshade_frame* frame, scanshade_frame_data* data);
SCANSHADE_API void scanshade_frame_free(scanshade_frame* frame);

/* Ambient occlusion as the program's `run` computes it for this frame, of its pixels or points as recorded. The noise
 * is measured on up to five frames of the capture, once. With the setting `sequence`, neighbouring frames are loaded.
 */
SCANSHADE_API scanshade_status scanshade_compute_frame(scanshade_session* session, const scanshade_frame* frame,
                                                       uint32_t outputs, scanshade_result** result);

/* ------------------------------------------------------------------------------------------------------ refine */

/* A refined camera, and how sure it is. */
typedef struct scanshade_refinement scanshade_refinement;

/* What the program's `refine` does: from a capture, or from a folder of pictures of a board with the setting `board`.
 */
SCANSHADE_API scanshade_status scanshade_refine(const char* path, const scanshade_setting* settings, size_t count,
                                                scanshade_refinement** refinement);
SCANSHADE_API scanshade_status scanshade_refinement_camera(const scanshade_refinement* refinement,
                                                           scanshade_camera* camera);
/* The JSON that `refine` writes as camera.json; "refinement" in it has sigmas, errors and the verdict. */
SCANSHADE_API const char* scanshade_refinement_report(const scanshade_refinement* refinement);
/* The same for people. */
SCANSHADE_API const char* scanshade_refinement_summary(const scanshade_refinement* refinement);
/* Refined poses of a recording, as lines of TUM's format; a comment alone without any. */
SCANSHADE_API const char* scanshade_refinement_trajectory(const scanshade_refinement* refinement);
SCANSHADE_API void scanshade_refinement_free(scanshade_refinement* refinement);

/* ------------------------------------------------------------------------------------------------------ relief */

/* Heights seen from above, in rows from north to south and columns from west to east: an array, or a file. They are
 * only read, and not after the call. */
typedef struct scanshade_heights {
    size_t size;
    const void* values;    /* FLOAT32 or FLOAT64, metres; not finite, or beyond 1e30 = no data */
    int32_t type;          /* scanshade_type */
    int32_t width, height; /* cells */
    int64_t row_bytes;     /* from one row to the next; 0 = rows are packed */
    double cell;           /* side of a cell, metres */
    const char* path;      /* a GeoTIFF or .vrt in place of the array; NULL = none */
} scanshade_heights;
#define SCANSHADE_HEIGHTS_INIT                                                                                         \
    { sizeof(scanshade_heights), NULL, SCANSHADE_FLOAT32, 0, 0, 0, 1, NULL }

typedef struct scanshade_relief_maps scanshade_relief_maps;

/* Maps as the program's `relief` computes them, with its settings: write (names of maps), radius (metres; 0 = 10
 * cells), directions, definition, profile, and others. Those of points and files of results belong to the program. */
SCANSHADE_API scanshade_status scanshade_relief(const scanshade_heights* heights, const scanshade_setting* settings,
                                                size_t count, scanshade_relief_maps** maps);
SCANSHADE_API scanshade_status scanshade_relief_size(const scanshade_relief_maps* maps, int32_t* width,
                                                     int32_t* height);
/* height x width floats of the map of that name ("svf", "openness-neg"), packed; NaN = no data. NULL for a map that was
 * not asked for. They live as long as the handle. */
SCANSHADE_API const float* scanshade_relief_map(const scanshade_relief_maps* maps, const char* name);
/* A JSON object: "maps" (names), "width", "height", "cell", "x0" and "y0" (the north-west corner, in the unit of the
 * coordinates), "unit_m", "epsg" (0 = none is named), "notes" (sentences: what was assumed). */
SCANSHADE_API const char* scanshade_relief_info(const scanshade_relief_maps* maps);
SCANSHADE_API void scanshade_relief_free(scanshade_relief_maps* maps);

#ifdef __cplusplus
}
#endif

#endif
