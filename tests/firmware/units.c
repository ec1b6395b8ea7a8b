/* Prints what the stub makes of physical units: a line for each joint. */

#include <stdio.h>

#include "firmware_stub/controller.h"

int main(void)
{
    for (uint32_t i = 0u; i < JOINTS; ++i) {
        const controller_number limit = controller_default_config.joint[i].TORQUE_LIMIT;
        (void)printf("%.9g %.9g %.9g %.9g %.9g %d\n", (double)controller_velocity(0.25f, i),
                     (double)controller_acceleration(-8.0f, i), (double)controller_torque(-2.5f),
                     (double)controller_torque_Nm(limit), (double)controller_inertia_kgm2(i),
                     (int)controller_torque_mNm(limit));
    }
    return 0;
}
