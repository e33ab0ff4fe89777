"""The virtual OpenCR board: IMU, voltage and the servos' power switch."""

from wire_talk import read, read_answers, request, write

from drivers.dynamixel import protocol2
from drivers.dynamixel.protocol2 import ErrorNumber, Instruction
from drivers.virtual_bus.devices.board import VirtualBoard
from drivers.virtual_bus.devices.chain import Chain
from drivers.virtual_bus.devices.device import Quirks
from drivers.virtual_bus.devices.servo import VirtualServo


def test_its_switch_powers_the_servos():
    servo = VirtualServo(1, quirks=Quirks(reboot_time=0.1))
    servo.powered = False
    board = VirtualBoard(on_power=lambda on: setattr(servo, "powered", on))
    chain = Chain([servo, board])
    ping = request(protocol2.ping(1).encode())
    assert chain.handle(ping) == []
    assert write(board, "dynamixel_power", 1) == 0
    assert chain.handle(ping) == []  # still starting
    chain.advance(0.2)
    assert len(chain.handle(ping)) == 1
    assert write(board, "dynamixel_power", 2) == ErrorNumber.DATA_RANGE
    assert write(board, "dynamixel_power", 0) == 0
    assert chain.handle(ping) == []


def test_imu_and_voltage_are_read_in_one_go():
    board = VirtualBoard()
    board.sense_imu([1, -2, 3], [-4, 5, 99_999])
    board.sense_voltage(11.84)
    span = board.table.span("present_input_voltage", "acc_z")
    answers = Chain([board]).handle(request(protocol2.read(200, span).encode()))
    (status,) = read_answers(answers)
    assert status.data == bytes((118,)) + b"".join(
        value.to_bytes(2, "little", signed=True) for value in (1, -2, 3, -4, 5, 32767)
    )


def test_measurements_are_read_only_and_servo_instructions_unknown():
    board = VirtualBoard()
    assert write(board, "gyro_x", 0) == ErrorNumber.ACCESS
    for instruction in (Instruction.REBOOT, Instruction.CLEAR, Instruction.BACKUP):
        status = board.handle(instruction)
        assert status is not None and status.number == ErrorNumber.INSTRUCTION


def test_without_power_the_board_is_gone_and_so_is_the_servos_power():
    switched = []
    board = VirtualBoard(on_power=switched.append)
    write(board, "dynamixel_power", 1)
    board.powered = False
    assert not board.listens and switched == [True, False]
    board.powered = True
    board.advance(1.0)
    assert board.listens and read(board, "dynamixel_power") == 0
