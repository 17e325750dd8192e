"""Density mixture: the new pair of densities for each element, and the bias between space and time.

Source: Stephens 2011, sec. 6.4.

Deviation: eq. 6.55–6.56 cancel where the mixture is nearly axis-aligned. The same quadratic is solved by
``q = -(B + sign(B) sqrt(B² - 4AD)) / 2`` with roots ``q / A`` and ``D / q``.
"""

from __future__ import annotations

import torch

from tsar.response.local import Box, Field, LocalConstraints
from tsar.roots import square_root


def smallest_root(a: Field, b: Field, d: Field) -> Field:
    """Smallest non-negative ``k`` with ``a k² + b k + d = 0``, 0 where there is none; the discriminant is clamped at
    0."""
    q = -0.5 * (b + torch.where(b < 0, -1.0, 1.0) * square_root((b * b - 4.0 * a * d).clamp(min=0.0)))
    first = torch.where(a != 0, q / torch.where(a != 0, a, 1.0), torch.inf)
    second = torch.where(q != 0, d / torch.where(q != 0, q, 1.0), torch.inf)
    root = torch.minimum(torch.where(first >= 0, first, torch.inf), torch.where(second >= 0, second, torch.inf))
    return torch.where(torch.isfinite(root), root, 0.0)


def mix(local: LocalConstraints, change: Field, box: Box, bias: float) -> tuple[Field, Field]:
    """The point b on the ray with the granted combined density, then moved along the iso-product curve to c.

    Where the errors have opposite signs and no more change was granted than desired, the rest of the response needs no
    density: b is then the point with the granted product and the ratio of the axes of b*, and b* itself if the whole
    change was granted. Sec. 6.3 and 6.4 say that such elements may redistribute; the ray alone would not move them,
    because it meets the curve again only at ``2 k*``, if at all.

    Deviation: the redistribution, of which the thesis gives no equation.

    Args:
        local: densities, mixture and distances, normalised.
        change: granted change of the normalised combined density.
        box: bounds.
        bias: octaves to move by along the curve, positive towards space; applied only where there is an error.

    Returns:
        New normalised spatial and temporal densities, inside the box.
    """
    a_s, a_t, m_s, m_t = local.a_s, local.a_t, local.m_s, local.m_t
    product, slope = m_s * m_t, a_s * m_t + a_t * m_s
    k = smallest_root(product, slope, -change)
    k = torch.minimum(torch.where(change == 0, 0.0, k), local.k_max)
    b_s, b_t = a_s + k * m_s, a_t + k * m_t
    redistribute = (product < 0) & (change.abs() <= local.desired_change.abs())
    after = a_s * a_t + change
    ratio = (a_s + local.k_min * m_s) / (a_t + local.k_min * m_t)
    slid = torch.minimum(torch.maximum(square_root(after * ratio), after), after / box.temporal_min)
    slid = slid.clamp(box.spatial_min, 1.0)
    b_s = torch.where(redistribute, slid, b_s).clamp(box.spatial_min, 1.0)
    b_t = torch.where(redistribute, after / slid, b_t).clamp(box.temporal_min, 1.0)
    if bias == 0.0:
        return b_s, b_t
    shift = torch.full_like(b_s, 2.0**bias)
    least = torch.maximum(box.spatial_min / b_s, b_t)
    most = torch.minimum(1.0 / b_s, b_t / box.temporal_min)
    shift = torch.where(local.active, torch.minimum(torch.maximum(shift, least), most), 1.0)
    return b_s * shift, b_t / shift
