# # A first hour
#
# This page compares two renderers, looks at the decisions of the adaptive one, adds a metric and a renderer of its own,
# and ends with a picture. It is one script, `docs/tutorial.py`, cut into pieces. The output of each piece stands below
# it. [Getting started](getting-started.md) says how to install what it needs, and [Concepts](concepts.md) explains the
# terms.
#
# The pieces share three numbers: seconds of animation, pixels along a side, and framelets a cycle. Smaller ones take
# less time.

SECONDS, SIDE_PX, BATCH = 1.0, 256, 64

# ## Compare two policies
#
# A *policy* is a way to spend samples. `thesis` is the adaptive pipeline of the dissertation. `framed` renders whole
# images, one after the other. Both get the same modelled cost for each second of animation. A reference with nine
# samples a pixel says what each should have shown.

from analysis import compare

options = {"seconds": SECONDS, "resolution_px": SIDE_PX, "batch_size": BATCH}
result = compare("fly-by", ["thesis", "framed"], out="out/tutorial", **options)
print(result.table()[["mse", "ratio", "share_suitable", "images"]].round(4))

# `mse` is the median of the mean squared error over the times of the reference. `ratio` is the median of the error of
# `thesis` over that of the other policy: below 1, `thesis` is better. `share_suitable` is the share of the times at
# which the ratio is at most 1. `images` counts what a display showed.
#
# The result keeps images of five times as one labelled array, in linear RGB.

print(dict(result.images.sizes))
last = result.images.isel(time_s=-1)

# To look at them, encode them approximately as a display does.

from matplotlib.figure import Figure


def encoded(image):
    return image.clip(0, 1) ** (1 / 2.2)


figure = Figure(figsize=(9.0, 3.3), layout="constrained")
for axis, run in zip(figure.subplots(1, 3), ["reference", "thesis", "framed"], strict=True):
    axis.imshow(encoded(last.sel(run=run)))
    axis.set(title=run, xticks=[], yticks=[])
figure.savefig("out/tutorial/shown.png", dpi=90)

# The framed renderer shows its last whole image, so all moving objects lag. The adaptive one shows samples of many
# ages.
#
# ## Load the run back
#
# The folder `out/tutorial` holds the report, a row for each cycle, and a summary. `load` returns the numbers with names
# on every axis ([xarray](https://docs.xarray.dev)), in this process or in a later one.

from analysis import load

run = load("out/tutorial")
print(dict(run.sizes))
print(run["mse"].median("time_s").round(4).to_series().to_string())

# Errors of the policies have the axis `time_s`. The decisions of the adaptive one have the axis `cycle`, and the axes
# `row` and `column` of its density fields.

figure = Figure(figsize=(9.0, 3.0), layout="constrained")
errors, tiles = figure.subplots(1, 2)
for name in run["run"].values:
    errors.plot(run["time_s"], run["mse"].sel(run=name), label=name)
errors.set(yscale="log", xlabel="time, s", ylabel="mean squared error")
errors.legend()
tiles.plot(run["cycle_time_s"], run["tile_count"])
tiles.set(xlabel="time, s", ylabel="tiles")
figure.savefig("out/tutorial/errors.png", dpi=90)

# ## Look at the densities
#
# Every element of the field has two densities: samples in space, and refreshes in time. Their product is the cost of
# the element in a cycle. The sum of these products does not change: what one element gains, others lose.

spent = (run["density_spatial"] * run["density_temporal"]).sum(("row", "column")) + run["surplus"]
print(f"spent in a cycle: {float(spent.min()):.3f} to {float(spent.max()):.3f} samples")

# Averages over the second half of the run show where the pipeline looks.

mean = run.isel(cycle=slice(run.sizes["cycle"] // 2, None)).mean("cycle")
figure = Figure(figsize=(9.0, 3.6), layout="constrained")
for axis, name, unit in zip(
    figure.subplots(1, 2),
    ["density_spatial", "density_temporal"],
    ["samples per element", "refreshes per cycle"],
    strict=True,
):
    drawn = axis.imshow(mean[name], norm="log")
    axis.set(title=name, xticks=[], yticks=[])
    figure.colorbar(drawn, ax=axis, label=unit)
figure.savefig("out/tutorial/densities.png", dpi=90)

# ## Measure in another way
#
# A metric is a function of two display-encoded images, the shown one and the reference. A lower value is better. This
# one is the error that the worst hundredth of the pixels exceed.


def worst_hundredth(shown, reference):
    return float((shown - reference).abs().amax(-1).flatten().quantile(0.99))


# ## Render in another way
#
# A policy of your own states its cost, requests samples, and makes an image of them. State goes in and comes out. This
# one renders a quarter of the pixels in a cycle, each quarter in turn, and shows the newest sample of each pixel.

import torch

from tsar import Moment, Picture, Policy, Price
from tsar.policies.scatter import pixel_batch, pixel_colors


class Quarters(Policy):
    """The state is the image; a cycle renews one pixel of every square of four."""

    @property
    def price(self):
        return Price(self.config.resolution_px**2 // 4)

    def start(self):
        return torch.zeros(self.config.resolution_px, self.config.resolution_px, 3)

    def turn(self, moment: Moment):
        row, column = [(0, 0), (1, 1), (0, 1), (1, 0)][moment.cycle % 4]
        return slice(row, None, 2), slice(column, None, 2)

    def request(self, state, moment: Moment):
        pixels = torch.arange(state.shape[0] ** 2).reshape(state.shape[:2])
        return state, pixel_batch(pixels[self.turn(moment)].reshape(-1), self.config, moment)

    def observe(self, state, batch, samples, moment: Moment, timer):
        image = state.clone()
        chosen = image[self.turn(moment)]
        chosen.copy_(pixel_colors(samples, self.config).reshape(chosen.shape))
        return image

    def image(self, state, moment: Moment):
        return Picture(state)


# Both are handed to `compare` as they are, and go by their own names. A folder holds one run at a time, so this run
# gets another folder; the reference is found again.

again = compare(
    "fly-by",
    ["thesis", "framed", Quarters],
    [worst_hundredth],
    out="out/tutorial-quarters",
    references="out/tutorial/references",
    **options,
)
print(again.table()[["mse", "ratio", "worst_hundredth"]].round(4))

figure = Figure(figsize=(9.0, 3.3), layout="constrained")
for axis, name in zip(figure.subplots(1, 3), ["thesis", "framed", "Quarters"], strict=True):
    off = abs(encoded(again.images.sel(run=name)) - encoded(again.images.sel(run="reference"))).isel(time_s=-1)
    axis.imshow(off.mean("channel"), cmap="gray_r", vmin=0, vmax=0.3)
    axis.set(title=f"{name}, off by", xticks=[], yticks=[])
figure.savefig("out/tutorial/off.png", dpi=90)

# On an input in which everything moves, an image that is renewed evenly is hard to beat: compare the two ratios. [The
# five inputs](results/comparison.md) shows where the adaptive pipeline wins and where it loses.
#
# [Extend](guides/extend.md) shows how a package adds policies, metrics and six other kinds of things by name, so that
# every command knows them.
#
# ## Render a picture
#
# The ray tracer that all policies use also renders single pictures. `tsar list scenes` prints the names of the scenes.

from renderer import render, write_image

write_image("out/tutorial/glass.png", render("glass", size=(480, 320), samples_per_pixel=64))

# Where to go from here: [Compare renderers](guides/compare.md) has all options of a comparison, [Render
# pictures](guides/render.md) all options of a picture, and [Results](results/index.md) the results of large runs.
