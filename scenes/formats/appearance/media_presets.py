"""Media by name: the tables of PBRT and of Mitsuba 0.5, with the differences between them.

Sources of the measurements: Jensen, Marschner, Levoy and Hanrahan 2001, "A Practical Model for Subsurface Light
Transport" (to Wholemilk); Narasimhan, Gupta, Donner, Ramamoorthi, Nayar and Jensen 2006, "Acquiring Scattering
Properties of Participating Media by Dilution".
"""

from __future__ import annotations

import numpy as np

from scenes.canonical import Medium
from scenes.formats.appearance.spectra import rgb

# name | reduced scattering σs (1 - g) | absorption, both per mm
_PBRT = """
Apple|2.29 2.39 1.97|.0030 .0034 .046
Chicken1|.15 .21 .38|.015 .077 .19
Chicken2|.19 .25 .32|.018 .088 .20
Cream|7.38 5.47 3.15|.0002 .0028 .0163
Ketchup|.18 .07 .03|.061 .97 1.45
Marble|2.19 2.62 3.00|.0021 .0041 .0071
Potato|.68 .70 .55|.0024 .0090 .12
Skimmilk|.70 1.22 1.90|.0014 .0025 .0142
Skin1|.74 .88 1.01|.032 .17 .48
Skin2|1.09 1.59 1.79|.013 .070 .145
Spectralon|11.6 20.4 14.9|0 0 0
Wholemilk|2.55 3.21 3.77|.0011 .0024 .014
Lowfat Milk|.89187 1.5136 2.532|.002875 .00575 .0115
Reduced Milk|2.4858 3.1669 4.5214|.0025556 .0051111 .012778
Regular Milk|4.5513 5.8294 7.136|.0015333 .0046 .019933
Espresso|.72378 .84557 1.0247|4.7984 6.5751 8.8493
Mint Mocha Coffee|.31602 .38538 .48131|3.772 5.8228 7.82
Lowfat Soy Milk|.30576 .34233 .61664|.0014375 .0071875 .035937
Regular Soy Milk|.59223 .73866 1.4693|.0019167 .0095833 .065167
Lowfat Chocolate Milk|.64925 .83916 1.1057|.0115 .0368 .1564
Regular Chocolate Milk|1.4585 2.1289 2.9527|.010063 .043125 .14375
Coke|8.9053e-5 8.372e-5 0|.10014 .16503 .2468
Pepsi|6.1697e-5 4.2564e-5 0|.091641 .14158 .20729
Sprite|6.0306e-6 6.4139e-6 6.5504e-6|.001886 .0018308 .0020025
Gatorade|.0024574 .003007 .0037325|.024794 .019289 .008878
Chardonnay|1.7982e-5 1.3758e-5 1.2023e-5|.010782 .011855 .023997
White Zinfandel|1.7501e-5 1.9069e-5 1.288e-5|.012072 .016184 .019843
Merlot|2.1129e-5 0 0|.11632 .25191 .29434
Budweiser Beer|2.4356e-5 2.4079e-5 1.0564e-5|.011492 .024911 .057786
Coors Light Beer|5.0922e-5 4.301e-5 0|.006164 .013984 .034983
Clorox|.0024035 .0031373 .003991|.0033542 .014892 .026297
Apple Juice|.00013612 .00015836 .000227|.012957 .023741 .052184
Cranberry Juice|.00010402 .00011646 7.8139e-5|.039437 .094223 .12426
Grape Juice|5.382e-5 0 0|.10404 .23958 .29325
Ruby Grapefruit Juice|.011002 .010927 .011036|.085867 .18314 .25262
White Grapefruit Juice|.22826 .23998 .32748|.0138 .018831 .056781
Shampoo|.0007176 .0008303 .0009016|.014107 .045693 .061717
Strawberry Shampoo|.00015671 .00015947 1.518e-5|.01449 .05796 .075823
Head & Shoulders Shampoo|.023805 .028804 .034306|.084621 .15688 .20365
Lemon Tea Powder|.040224 .045264 .051081|2.4288 4.5757 7.2127
Orange Powder|.00015617 .00017482 .0001762|.001449 .003441 .007863
Pink Lemonade Powder|.00012103 .00013073 .00012528|.001165 .002366 .003195
Cappuccino Powder|1.8436 2.5851 2.1662|35.844 49.547 61.084
Salt Powder|.027333 .032451 .031979|.28415 .3257 .34148
Sugar Powder|.00022272 .00025513 .000271|.012638 .031051 .050124
Suisse Mocha Powder|2.7979 3.5452 4.3365|17.502 27.004 35.433
Pacific Ocean Surface Water|.0001764 .00032095 .00019617|.031845 .031324 .030147
"""

# name | scattering | absorption | g, for red, green and blue
_MITSUBA = """
Apple|2.29 2.39 1.97|.0030 .0034 .046|0 0 0
Chicken1|.15 .21 .38|.0015 .077 .19|0 0 0
Chicken2|.19 .25 .32|.0018 .088 .20|0 0 0
Cream|7.38 5.47 3.15|.0002 .0028 .0163|0 0 0
Ketchup|.18 .07 .03|.061 .97 1.45|0 0 0
Marble|2.19 2.62 3.00|.0021 .0041 .0071|0 0 0
Potato|.68 .70 .55|.0024 .0090 .12|0 0 0
Skimmilk|.70 1.22 1.90|.0014 .0025 .0142|0 0 0
Skin1|.74 .88 1.01|.032 .17 .48|0 0 0
Skin2|1.09 1.59 1.79|.013 .070 .145|0 0 0
Spectralon|11.6 20.4 14.9|0 0 0|0 0 0
Wholemilk|2.55 3.21 3.77|.0011 .0024 .014|0 0 0
Lowfat Milk|13.1157 15.4445 17.9572|.00287 .00575 .01150|.932 .902 .859
Reduced Milk|13.7335 15.6003 17.8007|.00256 .00511 .01278|.819 .797 .746
Regular Milk|18.2052 20.3826 22.3698|.00153 .00460 .01993|.750 .714 .681
Espresso|7.78262 8.13050 8.53875|4.79838 6.57512 8.84925|.907 .896 .880
Mint Mocha Coffee|3.51133 4.14383 5.59667|3.77200 5.82283 7.82000|.910 .907 .914
Lowfat Soy Milk|2.03838 2.32875 3.90281|.00144 .00719 .03594|.850 .853 .842
Regular Soy Milk|4.66325 5.20183 8.74575|.00192 .00958 .06517|.873 .858 .832
Lowfat Chocolate Milk|9.83710 11.4954 13.1629|.01150 .03680 .15640|.934 .927 .916
Regular Chocolate Milk|10.5685 13.1416 15.2202|.01006 .04313 .14375|.862 .838 .806
Coke|.00254 .00299 0|.10014 .16503 .24680|.965 .972 0
Pepsi|.00083 .00203 0|.09164 .14158 .20729|.926 .979 0
Sprite|.00011 .00014 .00014|.00189 .00183 .00200|.943 .953 .952
Gatorade|.03668 .04488 .05742|.02479 .01929 .00888|.933 .933 .935
Chardonnay|.00021 .00033 .00048|.01078 .01186 .02400|.914 .958 .975
White Zinfandel|.00022 .00033 .00046|.01207 .01618 .01984|.919 .943 .972
Merlot|.00081 0 0|.11632 .25191 .29434|.974 0 0
Budweiser Beder|.00029 .00055 .00059|.01149 .02491 .05779|.917 .956 .982
Coors Light Beer|.00062 .00127 0|.00616 .01398 .03498|.918 .966 0
Clorox|.02731 .03302 .03695|.00335 .01489 .02630|.912 .905 .892
Apple Juice|.00257 .00311 .00413|.01296 .02374 .05218|.947 .949 .945
Cranberry Juice|.00196 .00238 .00301|.03944 .09422 .12426|.947 .951 .974
Grape Juice|.00138 0 0|.10404 .23958 .29325|.961 0 0
Ruby Grapefruit Juice|.15496 .15391 .15995|.08587 .18314 .25262|.929 .929 .931
White Grapefruit Juice|.50499 .52742 .75282|.01380 .01883 .05678|.548 .545 .565
Shampoo|.00797 .00874 .01127|.01411 .04569 .06172|.910 .905 .920
Strawberry Shampoo|.00215 .00245 .00253|.01449 .05796 .07582|.927 .935 .994
Head & Shoulders Shampoo|.26747 .27696 .29574|.08462 .15688 .20365|.911 .896 .884
Lemon Tea Powder|.74489 .83823 1.00158|2.42881 4.57573 7.21270|.946 .946 .949
Orange Juice Powder|.00193 .00213 .00226|.00145 .00344 .00786|.919 .918 .922
Pink Lemonade Powder|.00123 .00133 .00131|.00116 .00237 .00320|.902 .902 .904
Cappuccino Powder|12.2094 16.4659 29.2727|35.8441 49.5470 61.0844|.849 .843 .926
Salt Powder|.13805 .15677 .17865|.28415 .32570 .34148|.802 .793 .821
Sugar Powder|.00282 .00315 .00393|.01264 .03105 .05012|.921 .919 .931
Suisse Mocha Powder|30.0848 33.4452 38.7191|17.5020 27.0044 35.4334|.907 .894 .888
Pacific Ocean Surface Water|.00180 .00183 .00228|.03184 .03132 .03015|.902 .825 .914
"""

_MITSUBA_UNIT = 100.0  # the factor of coefficients from the table in Mitsuba 0.5


def _rows(text: str) -> dict[str, np.ndarray]:
    parts = (line.split("|") for line in text.strip().splitlines())
    return {name: np.array([[float(word) for word in words.split()] for words in rest]) for name, *rest in parts}


_PBRT_MEDIA = _rows(_PBRT)
_MITSUBA_MEDIA = {name.lower(): rows for name, rows in _rows(_MITSUBA).items()}


def pbrt_medium(name: str) -> Medium | None:
    """A medium of PBRT by its name, None for an unknown one.

    Source: PBRT v3 and v4, ``GetMediumScatteringProperties``: the reduced coefficients are those of scattering.
    """
    rows = _PBRT_MEDIA.get(name)
    return None if rows is None else Medium(rgb(rows[1]), rgb(rows[0]))


def mitsuba_medium(name: str) -> Medium | None:
    """A medium of Mitsuba 0.5 by its name in any case, None for an unknown one; ``g`` is the mean of the colours.

    Source: Mitsuba 0.5, ``lookupMaterial``.
    """
    rows = _MITSUBA_MEDIA.get(name.lower())
    if rows is None:
        return None
    scattering, absorption, g = rows
    return Medium(rgb(_MITSUBA_UNIT * absorption), rgb(_MITSUBA_UNIT * scattering), float(g.mean()))
