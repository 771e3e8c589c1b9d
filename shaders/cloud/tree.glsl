// The k-d tree of a cloud, balanced: node 1 holds all points, 2n and 2n + 1 the halves of n's; leaves are at level k.levels.
// Whoever walks down and leaves a sibling for later notes it in a bit of `trail`, the lowest for the node where it stands: no stack.

// On to the last sibling left; false when there is none.
bool next_sibling(inout uint node, inout uint trail) {
    if (trail == 0) return false;
    int up = findLSB(trail);
    trail = (trail >> up) ^ 1;
    node = (node >> up) ^ 1;
    return true;
}

// To a child of `node`, the right one or the left one; perhaps back to the other later.
void descend(inout uint node, inout uint trail, bool to_right, bool both) {
    node = 2 * node + uint(to_right);
    trail = (trail << 1) | uint(both);
}

// One thread a point, or a leaf.
uint own_number() {
    return (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
}
