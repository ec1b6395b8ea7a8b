#include "report.h"

#include "hal.h"

static void write_text(const char *text)
{
    for (uint32_t i = 0u; text[i] != '\0'; ++i) {
        hal_console_write(text[i]);
    }
}

static void write_unsigned(uint32_t number)
{
    char digits[10]; /* 2^32 has ten */
    uint32_t count = 0u;
    do {
        digits[count] = (char)('0' + (char)(number % 10u));
        number /= 10u;
        ++count;
    } while (number > 0u);
    while (count > 0u) {
        --count;
        hal_console_write(digits[count]);
    }
}

static void write_signed(int32_t number)
{
    hal_console_write(' ');
    if (number < 0) {
        hal_console_write('-');
        write_unsigned(0u - (uint32_t)number);
    } else {
        write_unsigned((uint32_t)number);
    }
}

void report_header(void)
{
    write_text("# tick mode fault status overruns slowest dropped counts.. torque_mNm..\n");
}

void report_record(const telemetry_record *record)
{
    write_unsigned(record->tick);
    write_signed((int32_t)record->mode);
    write_signed((int32_t)record->fault);
    write_signed(record->status);
    write_signed((int32_t)record->overruns);
    write_signed((int32_t)record->elapsed);
    write_signed((int32_t)record->dropped);
    for (uint32_t i = 0u; i < JOINTS; ++i) {
        write_signed(record->counts[i]);
    }
    for (uint32_t i = 0u; i < JOINTS; ++i) {
        write_signed(record->torque_mNm[i]);
    }
    hal_console_write('\n');
}

void report_number(const char *word, uint32_t number)
{
    write_text(word);
    hal_console_write(' ');
    write_unsigned(number);
    hal_console_write('\n');
}
