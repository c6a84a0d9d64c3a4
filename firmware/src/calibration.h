/* Which calibration this vehicle was built for; `agvbench calibrate --firmware FILE.h` writes one of your own. */
#define CALIBRATION_HASH "none"
