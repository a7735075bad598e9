/* An Arduino Uno in simavr, with a matrix behind its multiplexers, for tests/deploy/test_firmware.py.
 *
 *     board FIRMWARE.elf ROWS COLUMNS < frames > serial
 *
 * Standard input holds frames of ROWS x COLUMNS uint16 counts (0 to 1023), 15 for each second of the board's clock; after
 * the last one the board goes on with the first. Standard output is what it says on its serial line. It runs as fast as a
 * real one, until standard output is closed. */
#include <simavr/avr_adc.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum { HZ = 16000000, FRAME = HZ / 15, PORT_B = 0x25, PORT_D = 0x2B, MOST = 4096 };
static uint16_t frames[MOST][16 * 16];
static unsigned rows, columns, count;

/* The converter wants a voltage: that of the taxel which pins 2 to 5 and 6 to 9 choose. */
static void convert(struct avr_irq_t *irq, uint32_t value, void *param) {
    struct avr_t *avr = param;
    unsigned row = avr->data[PORT_D] >> 2 & 15, column = avr->data[PORT_D] >> 6 | (avr->data[PORT_B] & 3) << 2;
    unsigned counts = row < rows && column < columns ? frames[avr->cycle / FRAME % count][row * columns + column] : 0;
    avr_raise_irq(irq - ADC_IRQ_OUT_TRIGGER + ADC_IRQ_ADC0, (counts * 5000 + 1022) / 1023);
    (void)value;
}

static void say(struct avr_irq_t *irq, uint32_t value, void *param) {
    const char byte = (char)value;
    if (write(1, &byte, 1) != 1) exit(0);
    (void)irq, (void)param;
}

static void keep_pace(double seconds) {
    static struct timespec began;
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    if (!began.tv_sec) began = now;
    double ahead = seconds - (double)(now.tv_sec - began.tv_sec) - 1e-9 * (double)(now.tv_nsec - began.tv_nsec);
    if (ahead > 0) usleep((useconds_t)(1e6 * ahead));
}

int main(int argc, char **argv) {
    elf_firmware_t firmware = {0};
    if (argc != 4 || elf_read_firmware(argv[1], &firmware) != 0) return 2;
    rows = (unsigned)atoi(argv[2]), columns = (unsigned)atoi(argv[3]);
    while (count < MOST && fread(frames[count], 2 * rows * columns, 1, stdin) == 1) ++count;
    strcpy(firmware.mmcu, "atmega328p");
    firmware.frequency = HZ;
    struct avr_t *avr = avr_make_mcu_by_name(firmware.mmcu);
    if (!avr || !count) return 2;
    avr_init(avr);
    avr_load_firmware(avr, &firmware);
    avr->avcc = avr->aref = avr->vcc = 5000;
    uint32_t flags = 0; /* it shall not print what it is sent by itself */
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_OUT_TRIGGER), convert, avr);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), say, NULL);
    for (avr_cycle_count_t next = 0;;) {
        const int state = avr_run(avr);
        if (state == cpu_Done || state == cpu_Crashed) return 1;
        if (avr->cycle >= next) keep_pace((double)avr->cycle / HZ), next = avr->cycle + HZ / 100;
    }
}
