"""Several processes that train together: each its robots and GPU, and one that writes."""

from sim2real.training.distributed import DistributedProcess


def test_a_process_alone_does_as_it_is_asked():
    process = DistributedProcess.from_environment({})
    assert process.leads
    assert process.device("cpu") == "cpu"
    assert process.device("cuda:3") == "cuda:3"
    assert process.seed(7) == 7


def test_each_process_of_torchrun_has_robots_and_a_gpu_of_its_own():
    # Two machines of two GPUs each.
    environments = [{"RANK": str(i), "LOCAL_RANK": str(i % 2), "WORLD_SIZE": "4"} for i in range(4)]
    processes = [DistributedProcess.from_environment(environment) for environment in environments]
    assert [process.seed(7) for process in processes] == [7, 8, 9, 10]
    assert [process.device("cpu") for process in processes] == [
        "cuda:0",
        "cuda:1",
        "cuda:0",
        "cuda:1",
    ]
    assert [process.leads for process in processes] == [True, False, False, False]
