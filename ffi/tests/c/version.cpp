// The header from C++: names are not mangled, types need no `struct`.
#include "edgepuck.h"

int main()
{
    EdgepuckClassifier *classifier = nullptr;
    EdgepuckOptions options = edgepuck_options_default();
    EdgepuckStatus status = edgepuck_load("no/such", &options, &classifier);
    EdgepuckSensor *sensor = nullptr;
    EdgepuckStatus no_sensor = edgepuck_sensor_open("no such", &sensor);
    return status == EDGEPUCK_STATUS_BAD_MODEL && no_sensor == EDGEPUCK_STATUS_BAD_SENSOR &&
           *edgepuck_version() != '\0' ? 0 : 1;
}
