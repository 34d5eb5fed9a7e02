"""What is simulated: sensors, filters, attitude solvers and plants, as plain functions on scalars.

Conventions, obeyed everywhere
------------------------------
Units are SI: rad, rad/s, m/s^2, K, s, N.m. Datasheet units appear in the `sheet` modules of `sensors` alone.

Frames: n is east, north, up; b is right, forward, up of the body that carries the sensor.
Yaw (psi) is clockwise from north seen from above, pitch (theta) nose up, roll (gamma) right side down;
``C_nb = Rz(-psi) Rx(theta) Ry(gamma)`` turns body into navigation coordinates.
``q_nb`` is the same turn as a Hamilton quaternion, scalar first.

``w_nb_b``: angular rate of b against n, in b. ``f_b``: specific force in b, what an accelerometer feels
(``C_nb' (0, 0, g)`` at rest).

Noise: a one-sided density D gives samples at rate fs the standard deviation D sqrt(fs/2).
"""
