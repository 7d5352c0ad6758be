/* A PLC on libmodbus: a foreign map with every type and byte order. Prints its port, then serves one client at a time. */
#include <arpa/inet.h>
#include <modbus.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum { COILS = 10, DISCRETES = 20, HOLDING = 100, INPUT = 300, COUNT = 40 };

static void set_long(uint32_t value, uint16_t *words)
{
    words[0] = value >> 16;
    words[1] = value & 0xFFFF;
}

/* The names of libmodbus' own setters mean other orders on the wire from version to version. */
static void set_float(float value, const char *order, uint16_t *words)
{
    uint32_t bits, sent = 0;

    memcpy(&bits, &value, sizeof bits);
    for (; *order; order++)
        sent = sent << 8 | (bits >> 8 * ('D' - *order) & 0xFF);
    set_long(sent, words);
}

int main(void)
{
    modbus_t *plc = modbus_new_tcp("127.0.0.1", 0);
    modbus_mapping_t *map =
        modbus_mapping_new_start_address(COILS, 8, DISCRETES, 8, HOLDING, COUNT, INPUT, COUNT);
    struct sockaddr_in name;
    socklen_t length = sizeof name;
    uint8_t question[MODBUS_TCP_MAX_ADU_LENGTH];
    int listener = plc != NULL && map != NULL ? modbus_tcp_listen(plc, 4) : -1;

    if (listener < 0 || getsockname(listener, (struct sockaddr *)&name, &length) < 0)
        return 1;
    map->tab_bits[2] = 1;                                       /* coil 12 */
    map->tab_input_bits[1] = 1;                                 /* discrete input 21 */
    set_float(49.5f, "ABCD", map->tab_registers);               /* holding 100 */
    set_float(180.25f, "CDAB", map->tab_registers + 2);         /* 102 */
    set_float(26.125f, "BADC", map->tab_registers + 4);         /* 104 */
    set_float(14.5f, "DCBA", map->tab_registers + 6);           /* 106 */
    map->tab_registers[8] = 0x0008;                             /* 108: status word, bit 3 */
    map->tab_registers[9] = (uint16_t)-32768;                   /* 109: no value */
    map->tab_input_registers[0] = 1525;                         /* input 300: 1 mm */
    map->tab_input_registers[1] = (uint16_t)-5;                 /* 301: 0.1 L/s */
    set_long(14500, map->tab_input_registers + 2);              /* 302: W */
    set_long((uint32_t)-123456, map->tab_input_registers + 4);  /* 304 */
    set_long(1700000000, map->tab_input_registers + 6);         /* 306: seconds since 1970 */
    printf("%d\n", ntohs(name.sin_port));
    fflush(stdout);
    for (;;) {
        int length_of_question, client = modbus_tcp_accept(plc, &listener);

        if (client < 0)
            return 1;
        while ((length_of_question = modbus_receive(plc, question)) >= 0) {
            map->tab_input_registers[8]++;                      /* 308: heartbeat */
            if (length_of_question > 0)
                modbus_reply(plc, question, length_of_question, map);
        }
        close(client);
    }
}
