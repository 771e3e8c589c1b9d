// What host and shaders share of CACAO: the constant block, tile sizes, and the names of specialization constants.
// Symbols in comments are those of AMD's public documentation of FidelityFX CACAO 1.3 where it names them.
#ifndef SCANSHADE_SHARED_CACAO_H
#define SCANSHADE_SHARED_CACAO_H
#include "types.h"
SHARED_BEGIN

// Per-frame constants. Lengths in view units (metres for `scan`); the view frame inside this room is x right, y UP, z
// forward.
struct CacaoConstants {
    vec2 view_mul, view_add; // NDCToViewMul / Add: image UV -> view position at z = 1
    vec2 slice_inv;          // 1 / slice size
    vec2 image_inv;          // 1 / image size
    vec2 depth_unpack;       // mu, alpha: z = mu / (alpha - d) for device depth
    ivec2 image;             // W, H
    ivec2 slice;             // w, h of one de-interleaved layer
    ivec2 importance;        // size of the importance map
    ivec2 grid;              // size of the staged AO grid of the upsampler, halo of 2 included
    vec2 ray_step;           // scan: view ray change per image pixel (1/fx, -1/fy)
    vec2 ray_base;           // scan: view ray of pixel (0, 0)
    float outside_depth;     // reference: what an out-of-range depth load reads after linearisation
    float radius;            // R, EffectRadius
    float neg_rec_radius;    // -1 / R
    float near_limit_rec;    // kappa, EffectSamplingRadiusNearLimitRec
    float shadow_strength;   // already times 4.3
    float shadow_power;
    float shadow_clamp;
    float fade_mul, fade_add;
    float horizon;          // tau, sine of the angle below which a sample does not occlude
    float depth_offset;     // beta, DepthPrecisionOffsetMod
    float load_counter_div; // LoadCounterAvgDiv
    float adaptive_limit;   // AdaptiveSampleCountLimit
    float inv_sharpness;    // iota
    float sigma_spatial;    // BilateralSigmaSquared
    float sigma_depth;      // BilateralSimilarityDistanceSigma (a squared sigma)
    float detail_strength;
    float mip_weight;               // phi: weight of a mip sample is 1 + phi (z - nearest)^2
    float normals_mul, normals_add; // NormalsUnpackMul / Add
    int depth_stride;               // texels from one row of a depth slice to the next; mip m has stride >> m
    int depth_pitch;                // texels from one slice, with its mips, to the next
    int depth_mips;                 // T: 4/3 of mip 0 with its padding
    int depth_end;     // mip m of a slice starts at depth_end - (T >> 2m); a rim of holes, always 0, lies round each
    uint all_ones;     // 0xffffffff, unknown to the compiler (see cacao/cacao.glsl, whole())
    float spatial[10]; // upsampler: 1D spatial weight of tap -2 .. 2 for even, then odd pixels
};

// Rows of the buffer `pattern`: the taps but the last, which only HIGHEST reads, then 5 rotations for each of 4 slices.
const int cacao_taps = 31;

// Texels of a work group: a row of them where passes work on buffers, so that CPUs run along their caches' lines; a
// rectangle where they share memory on GPUs.
const int cacao_row = 64;
const int cacao_tile = 16;
const int cacao_mip_tile = 8;                        // prepare: one texel of mip 3
const int cacao_taps_wide = 20, cacao_taps_high = 8; // generate: whole blocks of the 5x4 that have all rotations
const int cacao_wide = 32, cacao_high = 32;          // finish: with a rim that is lent to neighbours only

// Specialization constants, the same numbers in every CACAO shader.
const int spec_spacing = 1;      // image pixels per AO grid pixel: 1 native, 2 downsampled
const int spec_kernel = 2;       // q: 0 LOWEST and LOW, 1 MEDIUM, 2 HIGH, 3 HIGHEST
const int spec_base = 3;         // 1: base pass of HIGHEST
const int spec_two_slices = 4;   // 1: LOWEST, only slices 0 and 3
const int spec_normals = 5;      // 1: normals supplied, 0: derived from depth
const int spec_device_depth = 6; // 1: input is device depth (normal-Z or reverse-Z), 0: metric linear z
const int spec_mips = 7;         // 1: depth mips are built and read
const int spec_first = 8;        // reference, blur: 1 for the first step
const int spec_last = 9;         // reference, blur: 1 for the last step; importance blur: 1 for the second
const int spec_halo = 10;        // reference, blur: texels of mirrored halo kept round each slice
const int spec_resolve = 11;     // reference, apply and upsample: 0 smart, 1 plain, 2 half
const int spec_power = 12;       // reference: 1 = output raised to 2.2, where AMD's shaders do
const int spec_steps = 13;       // finish: blur steps

// Resolve kinds, values of spec_resolve.
const int resolve_smart = 0;
const int resolve_plain = 1;
const int resolve_half = 2;

SHARED_END
#endif
