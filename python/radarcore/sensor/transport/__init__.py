"""Transport of bytes to and from a board: serial ports, USB, captures. It knows timeouts, and no protocol.

`serialport` alone names pyserial and `usbport` alone pyusb; both come with ``pip install radarcore[usb]`` and are
imported when the first port is looked for, so that captures play without them.
"""
