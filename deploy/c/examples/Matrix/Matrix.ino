// A pressure-sensitive matrix of up to 16 x 16 taxels, sent to gestured 15 times a second.
//
// Rows and columns are strips of conductive textile with a piezoresistive sheet between them. Two analog multiplexers with
// 16 channels (CD74HC4067) choose a taxel: the one on the rows connects a row to 5 V (3.3 V), the one on the columns connects
// a column to SIGNAL, where a resistor of some 10 kilohm goes to ground. More pressure is a larger number.
//
// Over the serial line, on the computer that the board is plugged into:
//     gestured --model cnn_lstm --grid 8x8
//     gestured-bridge serial /dev/ttyACM0 --protocol osc-slip --sensor armrest --grid 8x8 --baud 500000
#include <gestured_frames.h>

#define OVER_WIFI 0  // 1: over WiFi, to HOST; for the ESP32 and whatever else has WiFi.h

const char SENSOR[] = "armrest";
const uint8_t ROWS = 8, COLUMNS = 8;
const unsigned long PERIOD_US = 66667;

#if OVER_WIFI
// Anybody on this network can send frames in this sensor's name, and so make gestures: UDP has no password, and an address
// can be forged. So use a network on which there is nobody else, and the daemon's setting `allow`.
#include <WiFi.h>
#include <WiFiUdp.h>
char NETWORK[] = "the network's name", PASSWORD[] = "its password";
const char HOST[] = "192.168.7.2";  // where gestured runs with --listen 0.0.0.0:9000
const uint16_t PORT = 9000;
const uint8_t ROW_PINS[] = {16, 17, 18, 19}, COLUMN_PINS[] = {21, 22, 23, 25}, SIGNAL = 34;  // of an ESP32
WiFiUDP udp;
#else
const unsigned long BAUD = 500000;
const uint8_t ROW_PINS[] = {2, 3, 4, 5}, COLUMN_PINS[] = {6, 7, 8, 9}, SIGNAL = A0;  // of an Uno; bit 0 of the channel first
#endif

uint16_t counts[ROWS * COLUMNS];
uint32_t number = 0;
unsigned long due;

void choose(const uint8_t *pins, uint8_t channel) {
  for (uint8_t bit = 0; bit < 4; ++bit) digitalWrite(pins[bit], channel >> bit & 1);
}

void scan() {
  for (uint8_t row = 0; row < ROWS; ++row) {
    choose(ROW_PINS, row);
    for (uint8_t column = 0; column < COLUMNS; ++column) {
      choose(COLUMN_PINS, column);
      counts[row * COLUMNS + column] = analogRead(SIGNAL);
    }
  }
}

#if OVER_WIFI
void begin() { WiFi.begin(NETWORK, PASSWORD); }

void send(const struct gestured_frame *frame) {
  static uint8_t packet[sizeof counts + 128];
  const size_t size = gestured_packet(frame, packet, sizeof packet);
  if (WiFi.status() != WL_CONNECTED || !udp.beginPacket(HOST, PORT)) return;  // the counter tells of what was not sent
  udp.write(packet, size);
  udp.endPacket();
}
#else
void begin() { Serial.begin(BAUD); }

void put(void *, uint8_t byte) { Serial.write(byte); }

void send(const struct gestured_frame *frame) { gestured_slip(frame, put, 0); }
#endif

void setup() {
  for (uint8_t bit = 0; bit < 4; ++bit) {
    pinMode(ROW_PINS[bit], OUTPUT);
    pinMode(COLUMN_PINS[bit], OUTPUT);
  }
  begin();
  due = micros();
}

void loop() {
  scan();
  struct gestured_frame frame = gestured_uint16(SENSOR, counts, ROWS * COLUMNS);
  gestured_count(&frame, number++);
  send(&frame);
  due += PERIOD_US;
  const long wait = (long)(due - micros());
  if (wait > 0) delay(wait / 1000);
  else due = micros();  // this matrix takes longer: as fast as it can
}
