"""Real files that others made: they stand beside the project, never in it."""

from pathlib import Path

import matplotlib.pyplot as plt

#: Beside the project, seen from this folder, which is where the examples run.
FOLDER = Path("../../../../shared/data")


def real_files(address: str, figure: str, *names: str) -> list[Path]:
    """Return the files of these names; where one is missing say where it comes from, show the figure as it was, and return none."""
    paths = [FOLDER / name for name in names]
    if all(path.is_file() for path in paths):
        return paths
    print(f"The files are not here. They can be downloaded from {address}; this example looks for them beside the project, as")
    print("\n".join(f"  shared/data/{name}" for name in names))
    image = plt.imread(Path(__file__).parent / figure)
    size = image.shape[1] / 100.0, image.shape[0] / 100.0
    axes = plt.figure(figsize=size, dpi=100, layout="none").add_axes((0.0, 0.0, 1.0, 1.0))
    axes.imshow(image)
    axes.set_axis_off()
    return []
