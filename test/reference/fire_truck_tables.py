# Copyright 2026 ride_estimation contributors
"""Tables II and III of document 002 as printed: coefficients in N/m^n and N (s/m)^n, sums of squares."""

TABLE_2 = {
    1: dict(k_s=10000, k_t=44767, c_s=19882),
    2: dict(k_s=10000, k_t=56741, c_s=62045, c_t=5000),
    3: dict(k_s=739230, k_t=10000, c_s=8800, c_t=5000, n_ks=1.7236, n_kt=0.6529, n_cs=0.3414),
    4: dict(k_s=10000, k_t=51287, c_s=90587, c_t=5000),
    5: dict(k_s=109190, k_t=57040, c_s=59960, c_t=5000),
    6: dict(k_s=44550, k_t=60183, c_s=8948, c_t=5000, n_ks=0.7978, n_kt=1.0199, n_cs=0.4166),
}
TABLE_2_SUM = {1: 45.4653, 2: 35.9316, 3: 43.9029, 4: 33.7879, 5: 32.2651, 6: 31.1266}
#: (spring stiffness from geometry or FE [N/m], model) -> coefficients
TABLE_3 = {
    (522845.5, 2): dict(k_t=52780, c_s=100000, c_t=5000),
    (522845.5, 3): dict(k_t=10000, c_s=12985, c_t=5000, n_ks=1.5868, n_kt=0.8073, n_cs=0.2479),
    (522845.5, 5): dict(k_t=50300, c_s=100000, c_t=5000),
    (522845.5, 6): dict(k_t=27891, c_s=12158, c_t=5000, n_ks=1.3827, n_kt=0.7705, n_cs=0.5009),
    (328407.0, 2): dict(k_t=54070, c_s=100000, c_t=5000),
    (328407.0, 3): dict(k_t=10000, c_s=10889, c_t=5000, n_ks=1.4063, n_kt=0.7915, n_cs=0.3334),
    (328407.0, 5): dict(k_t=52510, c_s=100000, c_t=5000),
    (328407.0, 6): dict(k_t=32233, c_s=9668, c_t=5000, n_ks=1.26, n_kt=0.8145, n_cs=0.4245),
}
TABLE_3_SUM = dict(zip(TABLE_3, (38.4924, 55.4658, 38.2348, 31.6361, 38.4924, 53.3742, 33.7050, 31.5233)))
