"""Several processes that train together: each its robots and GPU, and one that writes."""

from sim2real.training.distributed import DistributedProcess


def test_a_process_alone_does_as_it_is_asked():
    rank = DistributedProcess.from_environment({})
    assert rank.leads
    assert rank.device("cpu") == "cpu"
    assert rank.device("cuda:3") == "cuda:3"
    assert rank.seed(7) == 7


def test_each_process_of_torchrun_has_robots_and_a_gpu_of_its_own():
    # Two machines of two GPUs each.
    environments = [{"RANK": str(i), "LOCAL_RANK": str(i % 2), "WORLD_SIZE": "4"} for i in range(4)]
    ranks = [DistributedProcess.from_environment(environment) for environment in environments]
    assert [rank.seed(7) for rank in ranks] == [7, 8, 9, 10]
    assert [rank.device("cpu") for rank in ranks] == ["cuda:0", "cuda:1", "cuda:0", "cuda:1"]
    assert [rank.leads for rank in ranks] == [True, False, False, False]
