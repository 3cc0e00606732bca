// The header from C++: names are not mangled, types need no `struct`.
#include "edgepuck_sim.h"

int main()
{
    EdgepuckSensor *sensor = nullptr;
    EdgepuckSimStatus status = edgepuck_sensor_open("no such", &sensor);
    return status == EDGEPUCK_SIM_STATUS_BAD_SENSOR && *edgepuck_sim_version() != '\0' ? 0 : 1;
}
