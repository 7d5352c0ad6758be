"""Where the kernel finds what: rows of the plain arrays that it works on.

Compiled code hands tuples of arrays over slowly (each use counts a reference), so the kernel gets few plain arrays,
and this page names their rows. `plant.py` packs the named parameters into them.
"""

# Numbers of the station, in one vector.
(
    OVERFLOW_LEVEL,
    WEIR_WIDTH,
    UNMETERED_INFLOW,
    STATIC_HEAD,
    FRICTION,
    IS_COMMON_HEADER,
    SHARED_FRICTION,
    LIFT_SLOPE,
    LIFT_REFERENCE,
    INERTIA,
    AIR_HEAD,
    AIR_GROWTH,
    AIR_PURGE,
    IS_AIR_SHARED,
    RAMP,
    MIN_FREQUENCY,
    DWELL,
    RAMP_POWER,
    RAMP_BOW,
    SPEED_LAG,
    CONTROL_DELAY,
    ROTATION,
    STARTS_PER_HOUR,
    IS_PID,
    PID_LEVEL,
    PID_GAIN,
    PID_INTEGRAL,
    PID_DERIVATIVE,
    VOLTAGE,
    RATED_CURRENT,
    POWER_FACTOR,
    PUMP_EFFICIENCY,
    MOTOR_EFFICIENCY,
    DRIVE_EFFICIENCY,
    SHUTOFF_POWER_SHARE,
    LOAD_SHARE,
) = range(36)

# Numbers of each pump: rows of (rows, pumps).
(
    C0,
    C1,
    C2,
    NOMINAL_FREQUENCY,
    RATED_HYDRAULIC,
    RATED_FLOW,
    RAGGING_LIMIT,
    RAGGING_TIME,
    SLIP,
    VALVE_LEAK,
    IS_AUTOMATIC,
) = range(11)

# Points of the wet well's profile: rows of (rows, points).
PROFILE_LEVEL, PROFILE_AREA, PROFILE_VOLUME = range(3)

# Start and stop levels: rows of (rows, levels).
START_LEVEL, STOP_LEVEL = range(2)

# Sensors and telemetry: rows of (rows, channels).
GAIN, OFFSET, FOLLOWED, NOISE, CORRELATION, CUTOFF, DELAY, QUANTUM, DEADBAND = range(9)

# State of the station, of the pumps and of the channels.
VOLUME, PID_SUM, PID_LAST_LEVEL, PID_HAS_LAST, WANTED_FREQUENCY, STATION_STATES = range(6)
(
    FREQUENCY_NOW,
    SHAFT_RATIO,
    SPEED_RATIO,
    FLOW_NOW,
    FLOW_BEFORE,
    MEAN_FLOW,
    AIR,
    LOAD,
    RAGGING,
    DWELL_LEFT,
    RUN_TIME,
    IS_COMMANDED,
    IS_READY,
    PUMP_STATES,
) = range(14)
DAMPED, LAST_NOISE, LAST_READING, LAST_SENT, CHANNEL_STATES = range(5)
RUNNING, TURN, SECOND, COUNTERS = range(4)

# What acts on the plant: rows of (rows, seconds), (rows, pumps, seconds) and (rows, channels, seconds).
INFLOW_FORCE, FRICTION_FACTOR, STATIC_RISE, VOLTAGE_FACTOR, IS_PLC_FROZEN, STATION_FORCES = range(6)
SPEED_FACTOR, HEAD_FACTOR, INTERNAL_LEAK, VALVE_LEAK_FORCE, IS_TRIPPED, PUMP_FORCES = range(6)
SENSOR_BIAS, NOISE_FACTOR, IS_STUCK, SENSOR_FORCES = range(4)

# What truly was: rows of (rows, seconds) and (rows, pumps, seconds).
TRUE_LEVEL, TRUE_OVERFLOW, STATION_TRUTHS = range(3)
TRUE_FLOW, TRUE_HEAD, TRUE_POWER, PUMP_TRUTHS = range(4)
