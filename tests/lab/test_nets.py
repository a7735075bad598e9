"""The networks: what follows a gesture changes no answer, and each of them can learn what it is shown."""

import pytest
import torch
from torch import Tensor, nn

from gestured.lab.fit import NETS, build
from gestured.lab.nets import CnnLstm, Decision, Lstm
from gestured.lab.trajectory import TrajectoryNet, trajectory_features
from gestured.model.features import ACTIVE
from tests.lab.made import gestures

MADE = gestures()
TEN = [name for name in MADE if not name.startswith("two_finger_")]


@pytest.fixture(scope="module")
def nets() -> nn.ModuleDict:
    torch.manual_seed(5)
    return build().eval()


def longer(frames: Tensor, tail: int, level: float, seed: int = 0) -> Tensor:
    """(T, R, C) with idle frames of at most `level` at the end; 0 is padding."""
    noise = torch.rand(tail, *frames.shape[1:], generator=torch.Generator().manual_seed(seed)) * level
    return torch.cat([frames, noise])


@pytest.mark.parametrize("level", [0.0, 0.99 * ACTIVE], ids=["padding", "idle"])
@pytest.mark.parametrize("name", NETS)
def test_what_follows_a_gesture_changes_no_logit(nets: nn.ModuleDict, name: str, level: float) -> None:
    with torch.no_grad():
        for frames in map(torch.from_numpy, MADE.values()):
            alone = nets[name](frames[None])
            for tail in (1, 60):
                torch.testing.assert_close(nets[name](longer(frames, tail, level)[None]), alone, atol=1e-6, rtol=1e-6)


@pytest.mark.parametrize("name", NETS)
def test_a_gesture_that_goes_on_is_told_from_one_that_is_over(nets: nn.ModuleDict, name: str) -> None:
    with torch.no_grad():
        for frames in map(torch.from_numpy, MADE.values()):
            over, on = nets[name](frames[None]), nets[name](frames[None, :-1])
            assert not torch.allclose(over, on, atol=1e-3)


@pytest.mark.parametrize("name", NETS)
def test_padding_is_no_end_where_the_length_is_known(nets: nn.ModuleDict, name: str) -> None:
    cut = [torch.from_numpy(f[:-1]) for f in MADE.values()]  # they end in a touched frame
    x = nn.utils.rnn.pad_sequence([*cut, torch.zeros(99, 9, 9)], batch_first=True)[: len(cut)]
    lengths = torch.tensor([len(f) for f in cut])
    with torch.no_grad():
        together = nets[name](x, lengths)
        alone = torch.cat([nets[name](f[None]) for f in cut])
        assert not torch.allclose(nets[name](x), alone, atol=1e-3)
    torch.testing.assert_close(together, alone, atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize("name", NETS)
def test_what_comes_before_the_last_contact_counts(nets: nn.ModuleDict, name: str) -> None:
    """A net that looked at nothing would pass everything above."""
    with torch.no_grad():
        found = torch.cat([nets[name](torch.from_numpy(f)[None]) for f in MADE.values()])
    assert len(torch.unique((found * 1e4).round(), dim=0)) == len(MADE)


@pytest.mark.parametrize(("kind", "rate"), [(CnnLstm, 1e-2), (Lstm, 2e-2), (TrajectoryNet, 1e-2)])
def test_one_batch_can_be_learned_by_heart(kind: type[nn.Module], rate: float) -> None:
    """Twenty made windows, a few dozen steps: gradients reach everything that matters."""
    torch.manual_seed(2)
    shown = [gestures(shift)[name] for shift in (0.0, 0.4) for name in TEN]
    x = nn.utils.rnn.pad_sequence([torch.from_numpy(f) for f in shown], batch_first=True)
    y = torch.arange(len(TEN)).repeat(2)
    net = kind(9, 9, len(TEN))
    if isinstance(net, TrajectoryNet):
        net.perceptron.fit_scale(trajectory_features(x))
    optimiser = torch.optim.AdamW(net.parameters(), lr=rate)
    net.train()
    for _ in range(60):
        loss = nn.functional.cross_entropy(net(x), y)
        optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimiser.step()
    net.eval()
    with torch.no_grad():
        right = float((net(x).argmax(1) == y).float().mean())
    assert right > 0.95


@pytest.mark.parametrize("size", [0.0, 1.0, 1e4, 1e30])
def test_a_decision_stays_finite_whatever_the_logits(size: float) -> None:
    decision = Decision(4)
    decision.weight.fill_(0.5)
    logits = torch.randn(50, 9, generator=torch.Generator().manual_seed(1)) * size
    scores, unknown = decision(logits, -logits)
    assert bool(torch.isfinite(scores).all())
    assert bool(torch.isfinite(unknown).all())
