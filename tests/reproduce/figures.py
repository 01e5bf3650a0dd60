"""How figures look: colours that colour-blind eyes can tell apart (Okabe and Ito 2008), one colour and one marker a way,
without the IMU dashed."""
import os

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402  (the backend comes first)
from matplotlib.ticker import FuncFormatter  # noqa: E402

STYLE = {"paper, IMU": dict(color="#009E73", marker="^", linestyle="-"),
         "paper, no IMU": dict(color="#E69F00", marker="v", linestyle="--"),
         "fathom, IMU": dict(color="#0072B2", marker="o", linestyle="-"),
         "fathom, no IMU": dict(color="#D55E00", marker="s", linestyle="--")}
MORE = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000"]
MARKERS = "osD^vPX"

plt.rcParams.update({"font.size": 9, "axes.titlesize": 10, "figure.dpi": 110, "axes.grid": True, "grid.alpha": 0.3,
                     "lines.linewidth": 1.6, "lines.markersize": 5, "legend.fontsize": 8, "legend.handlelength": 3.2,
                     "axes.spines.top": False, "axes.spines.right": False, "figure.constrained_layout.use": True})


def panels(count, height=3.4, width=9.6, **options):
    figure, axes = plt.subplots(1, count, figsize=(width if count > 1 else 0.7 * width, height), squeeze=False, **options)
    return figure, list(axes[0])


def line_style(way, markers=False):
    style = dict(STYLE[way])
    if not markers:
        style.pop("marker")
    return style


def legend_below(figure, axis, columns=4, rows=1):
    """One legend for all panels, from the lines of one of them."""
    share = 0.075 * rows * 3.4 / figure.get_size_inches()[1]
    figure.set_layout_engine("constrained", rect=(0, share, 1, 1 - share))
    figure.legend(*axis.get_legend_handles_labels(), loc="lower center", ncol=columns, frameon=False)


def plain(axis):
    """Numbers at a logarithmic axis as people write them."""
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def save(figure, folder, name):
    """Writes folder/name.png with few colours, which is enough for lines and keeps it small."""
    os.makedirs(folder, exist_ok=True)
    for axis in figure.axes:
        if axis.get_yscale() == "log":
            plain(axis.yaxis)
    path = os.path.join(folder, name + ".png")
    figure.savefig(path, metadata={"Software": None}, pil_kwargs={"optimize": True})
    plt.close(figure)
    shrink(path)
    return path


def shrink(path, colours=128):
    from PIL import Image
    with Image.open(path) as image:
        small = image.convert("RGB").quantize(colours, dither=Image.Dither.NONE)
    small.save(path, optimize=True)
