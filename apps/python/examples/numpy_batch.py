"""A stack of depth images, (N, H, W) uint16 millimetres in a .npy file, to AO: numpy_batch.py depth.npy FX FY CX CY ao.npy"""

import sys

import numpy as np

import scanshade

if len(sys.argv) != 7:
    sys.exit(__doc__)
depth = np.load(sys.argv[1], mmap_mode="r")
with scanshade.Session(method="surfel", radius=0.5) as session:
    result = session.ambient_occlusion(depth, [float(word) for word in sys.argv[2:6]])
np.save(sys.argv[6], result.ao)
print("\n".join(result.doubts) or f"mean visibility {np.nanmean(result.ao):.3f}")
