"""What the thesis prints, by place: sparse mapper, tables 5.3 to 5.13.

Its places are others than ours, so only relations between columns can be compared.
"""

PLACES = {
    "robotics_laboratory": "Biorobotics",
    "signal_laboratory": "Signal processing",
    "home_arena": "Megaweb",
    "apartment": "HSR apartment",
}
"""The thesis's place that each of ours stands for."""

USAGES = ("incremental", "full")

NODES = {
    "incremental": {
        "robotics_laboratory": (1445, 2459),
        "signal_laboratory": (1724, 2023),
        "home_arena": (745, 486),
        "apartment": (2850, 2426),
    },
    "full": {
        "robotics_laboratory": (361, 663),
        "signal_laboratory": (529, 1519),
        "home_arena": (462, 562),
        "apartment": (937, 1111),
    },
}
"""Free and occupied nodes, tables 5.5 and 5.6."""

MEANS = {
    "length": {
        "incremental": ((4.624, 3.728), (9.539, 9.51), (5.311, 5.364), (7.218, 7.241)),
        "full": ((4.220, 3.559), (9.445, 9.322), (5.369, 5.346), (7.389, 7.226)),
    },
    "points": {
        "incremental": ((80.974, 11.039), (176.877, 26.485), (94.343, 14.873), (126.605, 15.933)),
        "full": ((74.050, 8.677), (175.505, 23.382), (95.125, 13.158), (129.72, 17.141)),
    },
    "seconds": {
        "incremental": ((0.00236, 0.00215), (0.00806, 0.00715), (0.00882, 0.00447), (0.00634, 0.00549)),
        "full": ((0.00481, 0.00362), (0.0087, 0.0064), (0.0109, 0.00416), (0.0075, 0.00556)),
    },
    "dispersion": {
        "incremental": ((0.631, 0.682), (1.437, 1.524), (0.787, 0.882), (1.053, 1.184)),
        "full": ((0.593, 0.683), (1.426, 1.546), (0.799, 0.900), (1.081, 1.199)),
    },
    "turning": {
        "incremental": ((23.112, 5.258), (21.675, 11.177), (11.765, 7.506), (15.874, 8.243)),
        "full": ((17.772, 4.52), (21.435, 10.101), (11.697, 7.061), (16.335, 8.382)),
    },
}
"""Means of the navigation stack and of sparse maps in the order of ``PLACES``, tables 5.7 to 5.11."""

FAILURES = {
    "incremental": ((420, 324, 465), (401, 286, 536), (181, 142, 750), (101, 307, 679)),
    "full": ((534, 174, 440), (387, 228, 568), (170, 41, 816), (115, 89, 853)),
}
"""Of 1000 requests, not computed by the navigation stack and by sparse maps, computed by both, table 5.12."""

KILOBYTES = {
    "robotics_laboratory": (77.4, 1413.1, 120.3, 62.46, 30.9, 16.3),
    "signal_laboratory": (168.2, 3871.7, 117.5, 59.9, 61.5, 32.7),
    "home_arena": (248.3, 5202.7, 38.2, 19.69, 29.9, 16.3),
    "apartment": (121.7, 2771.8, 162.6, 84.4, 59.7, 32.7),
}
"""Of .bt, .ot, text and binary of the incremental map, text and binary of the full one, table 5.13."""

ERRORS = {
    "RGBD": {16: (1.7918, 1.7655, 1.7549), 64: (0.9106, 0.8803, 0.8668), 512: (0.3260, 0.3164, 0.3117)},
    "NYU": {16: (5.7932, 5.7823, 5.5929), 64: (2.7731, 2.7286, 2.6398), 512: (0.9048, 0.9044, 0.8366)},
    "Heavy": {16: (1.2718, 1.2400, 1.2520), 64: (0.6868, 0.6742, 0.6811), 512: (0.2682, 0.2630, 0.2640)},
}
"""Mean distances of K-means on a CPU, LBG and K-means++ by codes, table 5.3."""

SECONDS = {
    "RGBD": {16: (0.1344, 0.2094, 0.0878), 64: (0.3847, 0.7130, 0.2029), 512: (2.5117, 5.5480, 1.2069)},
    "NYU": {16: (0.1741, 0.2824, 0.1124), 64: (0.5084, 0.9476, 0.2560), 512: (3.3256, 7.4112, 1.5569)},
    "Heavy": {16: (1.4141, 2.3570, 0.8187), 64: (4.1520, 8.1108, 2.0085), 512: (27.7194, 61.4796, 13.0198)},
}
"""Times of the same [s], K-means++ with a GPU, table 5.4."""
