// CACAO generation from depth in images: what GPUs are fast at.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#define FOR_GPU
#include "cacao/generate.glsl"
