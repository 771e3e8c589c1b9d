#!/usr/bin/env python3
"""The house as its includes show it: rooms, arrows, floors; fails where rooms include each other in a circle.

    tests/house.py            a line for each wing, and circles
    tests/house.py --rooms    also each room's floor and the rooms that it includes
"""

import pathlib
import re
import sys

top = pathlib.Path(__file__).resolve().parent.parent
wings = ("projection", "io", "ao", "apps")
files = [pathlib.Path(f) for w in wings for e in ("h", "cpp") for f in (top / w).rglob(f"*.{e}")]
rooms = {f: str(f.parent.relative_to(top)) for f in files}
uses = {room: set() for room in rooms.values()}
for file, room in rooms.items():
    for included in re.findall(r'^#include "([^"]+)"', file.read_text(), re.M):
        other = str(pathlib.Path(included).parent)
        if other in uses and other != room and (top / included).exists():
            uses[room].add(other)


def circles():
    """Rooms that reach themselves, each with all it reaches and is reached by."""
    reach = {room: set(others) for room, others in uses.items()}
    for middle in uses:
        for room in uses:
            if middle in reach[room]:
                reach[room] |= reach[middle]
    return {frozenset(o for o in reach[room] if room in reach[o]) for room in uses if room in reach[room]}


def floor(room, memo={}):
    if room not in memo:
        memo[room] = 1 + max(map(floor, uses[room]), default=0)
    return memo[room]


found = circles()
for circle in found:
    print("circle: " + ", ".join(sorted(circle)))
    for room in sorted(circle):
        for file in sorted(f for f in rooms if rooms[f] == room):
            for included in re.findall(r'^#include "([^"]+)"', file.read_text(), re.M):
                if str(pathlib.Path(included).parent) in circle - {room}:
                    print(f"  {file.relative_to(top)} includes {included}")
if found:
    sys.exit(1)
for wing in wings:
    of_wing = [room for room in uses if room.split("/")[0] == wing]
    lines = sum(len(f.read_text().splitlines()) for f in files if rooms[f].split("/")[0] == wing)
    print(f"{wing}: {len(of_wing)} rooms, {sum(len(uses[r]) for r in of_wing)} arrows, floors {min(map(floor, of_wing))} to {max(map(floor, of_wing))}, {lines} lines")
if "--rooms" in sys.argv:
    for room in sorted(uses, key=lambda r: (floor(r), r)):
        print(f"{floor(room):3} {room}: {', '.join(sorted(uses[room]))}")
