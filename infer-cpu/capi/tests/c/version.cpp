// The header from C++: names are not mangled, types need no `struct`.
#include "edgepuck.h"

int main()
{
    EdgepuckClassifier *classifier = nullptr;
    EdgepuckOptions options = edgepuck_options_default();
    EdgepuckStatus status = edgepuck_load("no/such", &options, &classifier);
    return status == EDGEPUCK_STATUS_BAD_MODEL && *edgepuck_version() != '\0' ? 0 : 1;
}
