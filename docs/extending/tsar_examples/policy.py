"""A policy: every other row of pixels in turn, as on old television sets."""

import torch

from tsar import Moment, Picture, Policy, Price
from tsar.policies.scatter import pixel_batch, pixel_colors


class Interlaced(Policy[torch.Tensor]):
    """The state is the image; each cycle renews its even or its odd rows."""

    @property
    def price(self):
        return Price(self.config.resolution_px**2 // 2)

    def start(self):
        side = self.config.resolution_px
        return torch.zeros(side, side, 3)

    def request(self, state, moment: Moment):
        pixels = torch.arange(state.shape[0] ** 2).reshape(state.shape[:2])
        return state, pixel_batch(pixels[moment.cycle % 2 :: 2].reshape(-1), self.config, moment)

    def observe(self, state, batch, samples, moment: Moment, timer):
        image = state.clone()
        rows = image[moment.cycle % 2 :: 2]
        rows.copy_(pixel_colors(samples, self.config).reshape(rows.shape))
        return image

    def image(self, state, moment: Moment):
        return Picture(state)
