// A pixel's piece of surface, cut into patches that are shorter than a voxel. Expects lib/screen.glsl and grid.glsl.

const float steepest = 0.05;   // cosine of the view below which a patch grows no larger
const int most_patches = 8;
const float scale = 1048576.0; // coverages are summed as whole numbers, so that their order makes no difference

struct Patches {
    vec3 middle, apart; // in voxels of level 0
    vec3 coverage;      // of each, along the grid's axes, of a face of a voxel of its level
    int count, level;
};

// The coarsest voxels that a depth asks for: some pixels wide, and wider than noise.
int level_at(float z, vec2 ray_step, VxaoConstants c) {
    float wide = max(c.sampled * z * max(ray_step.x, ray_step.y), c.sigmas * sigma_of(z));
    return max(int(ceil(log2(wide * c.per_voxel))), 0);
}

// `point` and `n` in this view's space, seen from `eye`; `ray` is z = 1 in the space of the camera that saw it at depth z.
Patches patches_of(vec3 point, vec3 n, vec3 eye, vec3 ray, float z, float facing, vec2 ray_step, VxaoConstants c) {
    Patches patches;
    patches.level = level_at(max(z - k.radius, 0.5 * z), ray_step, c); // whoever is within the radius may ask
    float voxel = c.voxel * float(1 << min(patches.level, vxao_levels));
    float cosine = max(facing, steepest); // facing = |n ray|, ray of z = 1
    float area = z * z * ray_step.x * ray_step.y / cosine;
    // It is longest along the direction in the surface that leads away from the eye.
    vec3 view = point - eye;
    vec3 along = view - n * dot(n, view);
    float length2 = dot(along, along);
    along *= length2 > 0.0 ? inversesqrt(length2) : 0.0;
    float long_ = z * max(ray_step.x, ray_step.y) * inversesqrt(dot(ray, ray)) * dot(ray, ray) / cosine;
    patches.count = clamp(int(ceil(long_ / voxel)), 1, most_patches);
    patches.middle = in_grid(point, c);
    vec3 turned = vec3(dot(c.grid_x, along), dot(c.grid_y, along), dot(c.grid_z, along));
    patches.apart = turned * (long_ * c.per_voxel / float(patches.count));
    vec3 normal = abs(vec3(dot(c.grid_x, n), dot(c.grid_y, n), dot(c.grid_z, n)));
    patches.coverage = normal * (area / (voxel * voxel * float(patches.count)));
    return patches;
}

// The voxel of its level that a patch lies in.
ivec3 voxel_of(Patches patches, int i) {
    vec3 at = patches.middle + (float(i) + 0.5 - 0.5 * float(patches.count)) * patches.apart;
    return ivec3(floor(clamp(at, -1e6, 1e6))) >> patches.level;
}
