/* What the sketch calls of the ESP32's WiFi.h, so that its other half is compiled, too. It sends nothing. */
#pragma once
#include <Arduino.h>

enum { WL_CONNECTED = 3 };

struct WiFiClass {
    int begin(const char *, const char *) { return 0; }
    int status() { return 0; }
};
static WiFiClass WiFi;
