"""A Modbus device with some of everything that can be read."""

from acquisition.daq.register_memory import RegisterMemory


class Bench:
    """A device with some of everything that can be read."""

    step_s = 1.0
    ended = drained = False

    def __init__(self) -> None:
        self.memory = RegisterMemory(100, 300)
        self.memory.write(100, bytes(range(200)))
        self.bits = bytes([0b1010_0101, 0b11, 0xFF] * 100)
        self.queues = {100: b"", 7: bytes(range(62)), 8: b"", 9: bytes(64)}
        self.identification = {0: b"Acme", 1: b"DAQ-12", 2: b"1.4"}

    def read_registers(self, function, address, count):  # noqa: ARG002
        return self.memory.read(address, count)

    def read_bits(self, function, address, count):
        n_bytes = -(-count // 8)
        return self.bits[address // 8 : address // 8 + n_bytes] if function == 2 else bytes(n_bytes)

    def read_fifo(self, address):
        return self.queues.get(address)

    def produce(self, n_steps):
        pass

    def fault_names(self):
        return []

    def spoil(self, fault, count):
        pass
