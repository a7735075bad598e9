/* What the sketch calls of the ESP32's WiFiUdp.h. */
#pragma once
#include <Arduino.h>

struct WiFiUDP {
    int beginPacket(const char *, uint16_t) { return 1; }
    size_t write(const uint8_t *, size_t size) { return size; }
    int endPacket() { return 1; }
};
