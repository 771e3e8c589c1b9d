// The next view's turn.
#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "shared/vxao.h"

layout(local_size_x = 1) in;
layout(binding = 16, scalar) buffer Counters { uint counters[]; };

void main() { ++counters[vxao_view]; }
