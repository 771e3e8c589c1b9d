"""An Open3D tensor cloud with AO as an attribute of its points: open3d_cloud.py IN.ply OUT.ply"""

import sys

try:
    import open3d as o3d
except ImportError:
    print("skipped: no open3d")
    sys.exit()
import scanshade

if len(sys.argv) != 3:
    sys.exit(__doc__)
cloud = o3d.t.io.read_point_cloud(sys.argv[1])
normals = cloud.point.normals.numpy() if "normals" in cloud.point else None
ao = scanshade.point_ambient_occlusion(cloud.point.positions.numpy(), normals)
cloud.point["ambient_occlusion"] = o3d.core.Tensor(ao.copy().reshape(-1, 1))
o3d.t.io.write_point_cloud(sys.argv[2], cloud)
