"""An error norm: the mean over the three octants of each position's share of power."""


def mean_power(squared, repeat: int):
    return squared.mean(0) / repeat
