/* A host for Performax controllers on libusb-1.0: claim, vendor requests, a read before each write, blocks of 64 bytes.

   performax SERIAL TIMEOUT_MS COMMAND ... prints a line for each reply. A command that begins with = is sent without padding.
   Exit 1: an error, named with the call that met it. */
#include <libusb.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { VENDOR = 0x1589, PRODUCT = 0xA101, OUT = 0x02, IN = 0x82, BLOCK = 64 };
enum { FLUSH = 1, OPEN = 2, CLOSE = 4 };

static int check(int result, const char *what)
{
    if (result < 0) {
        fprintf(stderr, "%s: %s\n", what, libusb_error_name(result));
        exit(1);
    }
    return result;
}

static void request(libusb_device_handle *device, int value)
{
    check(libusb_control_transfer(device, 0x40, 0x02, value, 0, NULL, 0, 1000), "request");
}

static libusb_device_handle *opened(libusb_context *context, const char *wanted)
{
    libusb_device **devices;
    libusb_device_handle *device = NULL;
    struct libusb_device_descriptor about;
    unsigned char serial[BLOCK];
    ssize_t count = libusb_get_device_list(context, &devices);

    for (ssize_t i = 0; i < count && device == NULL; i++) {
        check(libusb_get_device_descriptor(devices[i], &about), "descriptor");
        if (about.idVendor != VENDOR || about.idProduct != PRODUCT)
            continue;
        check(libusb_open(devices[i], &device), "open");
        check(libusb_get_string_descriptor_ascii(device, about.iSerialNumber, serial, sizeof serial), "serial");
        if (strcmp((char *)serial, wanted) != 0) {
            libusb_close(device);
            device = NULL;
        }
    }
    libusb_free_device_list(devices, 1);
    return device;
}

int main(int count, char **arguments)
{
    unsigned char block[BLOCK];
    int timeout = atoi(arguments[2]), size, result;
    libusb_context *context;
    libusb_device_handle *device;

    check(libusb_init(&context), "init");
    device = opened(context, arguments[1]);
    if (device == NULL) {
        fprintf(stderr, "open: no controller\n");
        return 1;
    }
    check(libusb_claim_interface(device, 0), "claim");
    request(device, OPEN);
    request(device, FLUSH);
    for (int i = 3; i < count; i++) {
        const char *text = arguments[i];
        int length = BLOCK;
        result = libusb_bulk_transfer(device, IN, block, BLOCK, &size, 20);
        if (result == 0)
            printf("stale %.*s\n", size, block);
        else if (result != LIBUSB_ERROR_TIMEOUT)
            check(result, "read before");
        if (*text == '=')
            length = strlen(++text) + 1;
        memset(block, 0, BLOCK);
        strncpy((char *)block, text, BLOCK - 1);
        check(libusb_bulk_transfer(device, OUT, block, length, &size, timeout), "write");
        if (size != length)
            printf("short %d\n", size);
        check(libusb_bulk_transfer(device, IN, block, BLOCK, &size, timeout), "read");
        printf("%.*s\n", (int)strnlen((char *)block, size), block);
    }
    request(device, CLOSE);
    check(libusb_release_interface(device, 0), "release");
    libusb_close(device);
    libusb_exit(context);
    return 0;
}
