"""A capture as a torch Dataset of depth and AO, loaded by two processes: torch_dataset.py CAPTURE"""

import sys

try:
    import torch
    from torch.utils.data import DataLoader, Dataset
except ImportError:
    print("skipped: no torch")
    sys.exit()
import scanshade


class AoDataset(Dataset):
    """Each process has a device of its own: sessions are made where they are first used."""

    def __init__(self, path):
        self.capture = scanshade.open(path)  # can be pickled

    def __len__(self):
        return len(self.capture)

    def __getitem__(self, index):
        frame = self.capture[index]
        ao = scanshade.ambient_occlusion(frame, method="surfel").ao
        return torch.from_numpy(frame.depth.copy()), torch.from_numpy(ao.copy())  # torch wants arrays it may write


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    # "spawn": a forked process cannot use a device that its parent has opened
    for depth, ao in DataLoader(AoDataset(sys.argv[1]), batch_size=4, num_workers=2, multiprocessing_context="spawn"):
        print(tuple(depth.shape), f"mean visibility {ao.nanmean():.3f}")
