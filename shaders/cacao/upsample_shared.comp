// CACAO upsampling, second half, on GPUs: through shared memory.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#define FOR_GPU
#include "cacao/upsample.glsl"
