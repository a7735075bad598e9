"""The study's networks: causal, the same as a graph, the same for the same seed."""

import numpy as np
import pytest
import torch

from gestured.lab.study import training
from gestured.lab.study.material import classes
from gestured.lab.study.methods import METHODS
from gestured.lab.study.run_time import Graph
from gestured.lab.study.training import HistoryNet, SequenceNet
from tests.lab.study.material_made import samples

KINDS = ("lstm", "cnn_lstm", "cnn_gru")


@pytest.mark.parametrize("kind", KINDS)
def test_what_comes_later_changes_nothing(kind: str) -> None:
    net = SequenceNet(kind, 16, 10, 4).eval()
    x, at = torch.rand(3, 12, 9, 9), torch.tensor([4, 7, 0])
    other = x.clone()
    for row, last in enumerate(at):
        other[row, last + 1 :] = torch.rand(11 - int(last), 9, 9)
    with torch.no_grad():
        assert torch.allclose(net(x, at), net(other, at), atol=1e-5)
        assert not torch.allclose(net(x, at), net(x, at + 1))


@pytest.mark.parametrize("kind", KINDS)
def test_the_graph_answers_as_the_network_for_every_length(kind: str) -> None:
    net, images = SequenceNet(kind, 16, 10, 4).eval(), HistoryNet(10, 4).eval()
    graph, image = Graph.of_net(net), torch.rand(1, 9, 9)
    with torch.no_grad():
        for frames in (1, 3, 40):
            x = torch.rand(1, frames, 9, 9)
            expected = net(x, torch.tensor([frames - 1])).softmax(1).numpy()
            assert np.allclose(graph.run(x.numpy()), expected, atol=1e-4)
        assert np.allclose(Graph.of_net(images).run(image.numpy()), images(image).numpy(), atol=1e-4)


def test_the_same_seed_gives_the_same_network_and_another_seed_another() -> None:
    made = samples(2)
    inputs, index, labels = training.Windows(made, False), np.arange(len(made)), classes(made)

    def scores(seed: int) -> np.ndarray:
        values = {"units": 8, "rate": 5e-3, "steps": 6}
        return METHODS["lstm"].fit(inputs, index, labels, 10, values, seed).scores(inputs, index)

    assert np.array_equal(scores(1), scores(1))
    assert not np.allclose(scores(1), scores(2))


def test_scores_come_in_the_order_that_was_asked_for() -> None:
    made = samples(2)
    inputs = training.Windows(made, False)
    net = training.Net(SequenceNet("lstm", 8, 10).eval())
    index = np.random.default_rng(0).permutation(len(made))
    assert np.allclose(net.scores(inputs, index), net.scores(inputs, np.arange(len(made)))[index], atol=1e-6)
