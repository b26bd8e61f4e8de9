// Lines of an IMU with a serial output of its own, received by software on D8; only built with IMU_BAUD.
#ifndef IMU_H
#define IMU_H

#include <stdint.h>

#include "protocol.h"

void imu_init(void);

// Copy the line that has come, without its end, and return its length; 0 if none has.
uint8_t imu_line(char text[TEXT_MAX]);

#endif
