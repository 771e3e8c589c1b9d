"""What Open3D's readers find in clouds: read_by_open3d.py FILE... prints one JSON object: file -> field -> numbers, point by point.

For Debian's python3-open3d; programs_test.cpp compares.
"""
import json
import sys

import open3d

print(json.dumps({file: {name: values.numpy().astype(float).ravel().tolist()
                         for name, values in open3d.t.io.read_point_cloud(file).point.items()} for file in sys.argv[1:]}))
