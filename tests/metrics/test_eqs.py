"""The Event Quality Score: identities, invariances, refusals."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from eqs.events import Events
from eqs.metrics import (
    Centre,
    Definition,
    EventQualityScore,
    Judge,
    Reading,
    feature_centres,
    patch_cosine,
    pool_patches,
    score_streams,
    smooth_patches,
    whitening_matrix,
)
from eqs.metrics.definition import kinds
from eqs.metrics.silence import Silence

PAPER = {"features": "raw", "distance": "cosine", "patch_size": 3}
BASE = Definition(bins=2, window_us=50_000, **PAPER)
HEADLINE = Definition(bins=2)
TAPS = ("gate", "hidden", "downsample")


def readings(*taps, centres=None):
    plain = [
        Reading(definition=each)
        for tap in taps
        for each in (replace(BASE, tap=tap), replace(HEADLINE, tap=tap))
    ]
    return plain + [
        Reading(definition=replace(BASE, tap=tap, features=features), centre=centre)
        for tap, centre in (centres or {}).items()
        for features in ("centred", "whitened")
    ]


@pytest.fixture
def centres(backbone, make_events):
    return feature_centres(backbone, [make_events(11), make_events(12)], taps=TAPS, definition=BASE)


def test_identical_streams_score_one(backbone, make_events, centres):
    events = make_events(1)
    (scores,) = score_streams(backbone, events, [events], readings(*TAPS, centres=centres))
    assert set(scores) == {f"{tap}_{kind}" for tap in TAPS for kind in kinds()["features"]}
    for score in scores.values():
        assert score.score == pytest.approx(1, abs=1e-6)
        np.testing.assert_allclose(score.map, 1, atol=1e-6)
        np.testing.assert_allclose(score.curve, 1, atol=1e-6)


def test_score_is_symmetric(backbone, make_events, centres):
    a, b = make_events(1), make_events(2, count=1500)
    limits = {"start_us": 0, "stop_us": 1_000_000}
    (there,) = score_streams(backbone, a, [b], readings(*TAPS, centres=centres), **limits)
    (back,) = score_streams(backbone, b, [a], readings(*TAPS, centres=centres), **limits)
    for name, score in there.items():
        assert back[name].score == pytest.approx(score.score, abs=1e-5)
        assert score.score < 0.999


@pytest.mark.parametrize("chunk_windows", [1, 7, 100])
def test_a_watcher_sees_every_window_that_counts(backbone, make_events, chunk_windows):
    definition = replace(BASE, warmup_windows=4)
    seen = []
    score_streams(
        backbone,
        make_events(1),
        [make_events(2), make_events(3)],
        [Reading(definition=definition)],
        chunk_windows=chunk_windows,
        watch=lambda pooled: seen.append(pooled[definition.maps][0]),
    )
    windows = sum(len(stage) for stage in seen)
    assert windows == 19 - definition.warmup_of(19)
    assert all(len(stage) and stage.shape[1] == 3 for stage in seen)


@pytest.mark.parametrize("chunk_windows", [1, 7, 100])
def test_chunk_length_does_not_matter(backbone, make_events, centres, chunk_windows):
    real, candidates = make_events(1), [make_events(2)]
    ways = readings(*TAPS, centres=centres)
    (expected,) = score_streams(backbone, real, candidates, ways, chunk_windows=3)
    (scores,) = score_streams(backbone, real, candidates, ways, chunk_windows=chunk_windows)
    for name, score in scores.items():
        assert score.score == pytest.approx(expected[name].score, abs=1e-5)
        np.testing.assert_allclose(score.curve, expected[name].curve, atol=1e-5)
        np.testing.assert_allclose(score.map, expected[name].map, atol=1e-5)


def test_candidates_do_not_see_each_other(backbone, make_events):
    real = make_events(1)
    candidates = [make_events(seed, count=500 * seed) for seed in (2, 3, 4)]
    limits = {"start_us": 100_000, "stop_us": 900_000}
    together = score_streams(backbone, real, candidates, readings("hidden"), **limits)
    alone = [
        score_streams(backbone, real, [each], readings("hidden"), **limits)[0]
        for each in candidates
    ]
    for a, b in zip(together, alone, strict=True):
        assert a["hidden_raw"].score == pytest.approx(b["hidden_raw"].score, abs=1e-5)
    assert len({round(each["hidden_raw"].score, 4) for each in together}) == 3


def test_clocks_may_be_moved_together(backbone, make_events):
    a, b = make_events(1), make_events(2)
    (here,) = score_streams(backbone, a, [b], readings("hidden"))
    (there,) = score_streams(backbone, a.shifted(777_123), [b.shifted(777_123)], readings("hidden"))
    assert there["hidden_raw"].score == pytest.approx(here["hidden_raw"].score, abs=1e-9)


def test_score_is_the_mean_over_patches_stages_and_windows_after_warmup(backbone):
    real, simulated = torch.randint(0, 4, (2, 9, 4, 16, 24)).to(torch.uint8)
    (scores,) = score_streams(backbone, real, [simulated], readings("hidden"))
    maps, _ = backbone.taps(torch.stack([real, simulated], dim=1).float(), None)
    by_stage = []
    for stage in maps["hidden"]:
        pooled = pool_patches(stage)
        cosine = patch_cosine(pooled[:, 0], pooled[:, 1])
        by_stage.append(cosine[2:].mean().item())
    score = scores["hidden_raw"]
    assert (score.warmup, score.n_windows, len(score.curve)) == (2, 7, 9)
    assert score.by_stage == pytest.approx(by_stage, abs=1e-6)
    assert score.score == pytest.approx(np.mean(by_stage), abs=1e-6)
    assert score.curve[2:].mean() == pytest.approx(score.score, abs=1e-12)
    assert score.distance == pytest.approx(1 - score.score)


def test_state_is_carried_and_starts_at_zero(backbone):
    real, simulated = torch.randint(0, 4, (2, 8, 4, 16, 24)).to(torch.uint8)
    ways = [Reading(definition=replace(BASE, warmup_windows=0))]
    (both,) = score_streams(backbone, real, [simulated], ways)
    (head,) = score_streams(backbone, real[:3], [simulated[:3]], ways)
    (tail,) = score_streams(backbone, real[3:], [simulated[3:]], ways)
    np.testing.assert_allclose(both["hidden_raw"].curve[:3], head["hidden_raw"].curve, atol=1e-6)
    assert np.abs(both["hidden_raw"].curve[3:5] - tail["hidden_raw"].curve[:2]).min() > 1e-4


def test_a_state_that_is_reset_makes_every_window_a_stream_of_its_own(backbone):
    real, simulated = torch.randint(0, 4, (2, 8, 4, 16, 24)).to(torch.uint8)
    ways = [Reading(definition=replace(BASE, warmup_windows=0, state="reset"))]
    (both,) = score_streams(backbone, real, [simulated], ways, chunk_windows=3)
    for index in range(8):
        part = slice(index, index + 1)
        (alone,) = score_streams(backbone, real[part], [simulated[part]], ways)
        assert both["hidden_raw"].curve[index] == pytest.approx(alone["hidden_raw"].score, abs=1e-6)


def test_a_grid_compares_parts_of_the_map(backbone):
    real, simulated = torch.randint(0, 4, (2, 4, 4, 16, 24)).to(torch.uint8)
    ways = [Reading(definition=replace(BASE, warmup_windows=0, patch="grid", patch_size=2))]
    (scores,) = score_streams(backbone, real, [simulated], ways)
    maps, _ = backbone.taps(torch.stack([real, simulated], dim=1).float(), None)
    by_stage = []
    for stage in maps["hidden"]:  # 8x12, 4x6 and 2x3 cells: the last has three columns in two parts
        half = -(-stage.shape[-1] // 2)
        rows = stage.unflatten(-2, (2, -1)).mean(dim=-2)
        parts = torch.stack([rows[..., :half].mean(-1), rows[..., -half:].mean(-1)], dim=-1)
        by_stage.append(patch_cosine(parts[:, 0], parts[:, 1]).mean().item())
    assert scores["hidden_raw"].by_stage == pytest.approx(by_stage, abs=1e-6)
    assert scores["hidden_raw"].map.shape == (2, 2)
    assert scores["hidden_raw"].patch_px is None


def test_smooth_patches_are_compared_in_the_place_of_plain_ones(backbone):
    real, simulated = torch.randint(0, 4, (2, 4, 4, 16, 24)).to(torch.uint8)
    ways = [Reading(definition=replace(BASE, warmup_windows=0, pooling="smooth"))]
    (scores,) = score_streams(backbone, real, [simulated], ways)
    maps, _ = backbone.taps(torch.stack([real, simulated], dim=1).float(), None)
    by_stage = []
    for stage in maps["hidden"]:
        pooled = smooth_patches(stage)
        by_stage.append(patch_cosine(pooled[:, 0], pooled[:, 1]).mean().item())
    assert scores["hidden_raw"].by_stage == pytest.approx(by_stage, abs=1e-6)
    assert scores["hidden_raw"].patch_px == 6
    assert scores["hidden_raw"].map.shape == (3, 4)


def test_a_mask_leaves_out_what_is_silent_in_both(backbone):
    real, simulated = torch.randint(1, 4, (2, 4, 4, 24, 48)).to(torch.uint8)
    for stream in (real, simulated):
        stream[..., 24:] = 0  # patches of the coarsest stage are 24 pixels wide
        stream[2] = 0
    ways = [Reading(definition=replace(BASE, warmup_windows=0, mask="active", state="reset"))]
    (scores,) = score_streams(backbone, real, [simulated], ways)
    halves = [stream[[0, 1, 3], ..., :24] for stream in (real, simulated)]
    unmasked = [Reading(definition=replace(BASE, warmup_windows=0, state="reset"))]
    (expected,) = score_streams(backbone, halves[0], [halves[1]], unmasked)
    found, wanted = scores["hidden_raw"], expected["hidden_raw"]
    assert found.score == pytest.approx(wanted.score, abs=1e-6)
    assert np.isnan(found.curve).tolist() == [False, False, True, False]
    np.testing.assert_allclose(found.map[:, : found.map.shape[1] // 2], wanted.map, atol=1e-6)
    assert np.isnan(found.map[:, found.map.shape[1] // 2 :]).all()


def test_normalised_counts_leave_the_number_of_events_out(backbone):
    few, other = torch.randint(0, 3, (2, 6, 4, 16, 24)).to(torch.uint8)
    few[2] = other[2] = 0
    candidates = [3 * few, other, torch.zeros_like(few)]

    def scores_of(counts, reference):
        ways = [Reading(definition=replace(BASE, counts=counts))]
        found = score_streams(backbone, reference, candidates, ways)
        return [by_reading["hidden_raw"].score for by_reading in found]

    same, different, blank = scores_of("normalised", few)
    assert same == pytest.approx(1, abs=1e-6)
    assert max(different, blank) < 0.99
    assert scores_of("raw", few)[0] < 0.999
    assert scores_of("normalised", torch.zeros_like(few))[2] == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize(
    "other",
    [
        {"counts": "normalised"},
        {"pooling": "smooth"},
        {"pooling": "smooth", "patch": "grid"},
        {"pooling": "smooth", "mask": "active"},
    ],
)
def test_identity_symmetry_and_chunks_of_other_choices(backbone, make_events, other):
    definition = replace(BASE, **{"features": "centred", **other})
    a, b = make_events(1), make_events(2, count=1500)
    centre = feature_centres(backbone, [make_events(11)], taps=["hidden"], definition=definition)
    ways = [Reading(definition=definition, centre=centre["hidden"])]

    def scores_of(reference, candidates, chunk_windows=None):
        found = score_streams(
            backbone,
            reference,
            candidates,
            ways,
            start_us=0,
            stop_us=1_000_000,
            chunk_windows=chunk_windows,
        )
        return [by_reading["hidden_centred"].score for by_reading in found]

    identity, there = scores_of(a, [a, b])
    assert identity == pytest.approx(1, abs=1e-6)
    assert there < 0.999
    assert scores_of(b, [a]) == pytest.approx([there], abs=1e-5)
    for length in (1, 7):
        assert scores_of(a, [b], length) == pytest.approx([there], abs=1e-5)


def test_silence_equals_silence_under_a_mask(backbone):
    blank = torch.zeros(4, 4, 16, 24, dtype=torch.uint8)
    ways = [Reading(definition=replace(BASE, mask="active"))]
    (scores,) = score_streams(backbone, blank, [blank], ways)
    assert scores["hidden_raw"].score == 1


def test_map_points_at_the_damage(backbone, make_events):
    real = make_events(1, height=48, width=48, count=30_000)
    broken = (real.x >= 24) & (real.y < 24)
    kept = ~broken
    damaged = Events(*(getattr(real, name)[kept] for name in "txyp"), height=48, width=48)
    (scores,) = score_streams(backbone, real, [damaged], readings("downsample"))
    image = scores["downsample_raw"].map
    assert scores["downsample_raw"].patch_px == 6
    assert image.shape == (8, 8)
    assert image[:4, 4:].max() < image[4:].min()
    np.testing.assert_allclose(image[4:], 1, atol=1e-6)


def test_padding_of_the_backbone_is_cut_off(backbone, make_events):
    class Padded:
        """Garbage where the image is padded."""

        strides = backbone.strides

        def taps(self, x, states, stages, names):
            maps, states = backbone.taps(x, states, stages=stages, names=names)
            grown = {
                name: [torch.nn.functional.pad(m, (0, 5, 0, 4), value=9.0) for m in by_stage]
                for name, by_stage in maps.items()
            }
            return grown, states

    a, b = make_events(1, height=16, width=24), make_events(2, height=16, width=24)
    (plain,) = score_streams(backbone, a, [b], readings("hidden"))
    (padded,) = score_streams(Padded(), a, [b], readings("hidden"))
    assert padded["hidden_raw"].score == plain["hidden_raw"].score


def test_scoring_leaves_no_trace_on_the_backbone(backbone, make_events):
    backbone.train()
    score_streams(backbone, make_events(1), [make_events(2)], readings("hidden"))
    assert backbone.training
    assert all(p.requires_grad and p.grad is None for p in backbone.parameters())


def test_one_reference_pass_serves_all(backbone, make_events):
    candidates = [make_events(seed) for seed in range(2, 6)]
    ways = [each for each in readings(*TAPS) if each.definition.features == "raw"]
    score_streams(backbone, make_events(1), candidates, ways, chunk_windows=100)
    assert backbone.calls == 1
    score_streams(backbone, make_events(1), candidates, readings(*TAPS), chunk_windows=100)
    assert backbone.calls == 3  # and one more of silence


def test_a_late_simulator_is_scored_as_silent_and_not_over_what_is_left(backbone, make_events):
    real, late = make_events(1), make_events(1)
    late = late.window(500_000, 1_000_000)
    metric = EventQualityScore(Judge.of(backbone, bins=2))
    metric.update(late, real)
    assert len(metric.last.curve) == 19
    assert np.nanmax(metric.last.curve[:9]) < metric.last.curve[12:].min()
    whole = metric.last.score
    metric.update(late, real, 500_000, 1_000_000)
    assert metric.last.score == pytest.approx(1, abs=1e-6)
    assert whole < 0.995


def test_a_stated_span_narrows_what_is_scored(backbone, make_events):
    real, late = make_events(1), make_events(2).window(500_000, 1_000_000)
    metric = EventQualityScore(Judge.of(backbone, bins=2))
    metric.update(replace(late, span_us=(500_000, 900_000)), real)
    stated = metric.last.curve
    metric.update(late, real, 500_000, 900_000)
    np.testing.assert_array_equal(stated, metric.last.curve)
    assert len(stated) == 8


@pytest.mark.parametrize("features", ["raw", "silence", "centred", "whitened"])
@pytest.mark.parametrize("mask", ["none", "active"])
def test_the_loss_is_the_distance_and_has_gradients(backbone, make_events, features, mask):
    judge = Judge.of(backbone, bins=2).centred_on([make_events(11), make_events(12)])
    chosen = {"features": features, "mask": mask, "patch_size": 3, "warmup_windows": 2}
    metric = EventQualityScore(judge, **chosen)
    real, simulated = torch.randint(0, 4, (2, 9, 4, 16, 24)).float()
    simulated.requires_grad_()
    loss = metric.loss(simulated, real)
    metric.update(simulated.detach(), real)
    assert loss.item() == pytest.approx(metric.last.distance, abs=1e-6)
    loss.backward()
    step = 0.01 * simulated.grad / simulated.grad.norm()
    assert metric.loss(simulated.detach() - step, real) < loss.item()
    assert simulated.grad[:2].abs().max() > 0  # the warm-up acts on what follows it


def test_metric_averages_sequences_with_equal_weight(backbone, make_events):
    metric = EventQualityScore(Judge.of(backbone, bins=2))
    scores = []
    for seed, stop_us in ((1, 400_000), (3, 900_000)):
        metric.update(make_events(seed, stop_us=stop_us), make_events(seed + 1, stop_us=stop_us))
        scores.append(metric.last.score)
    assert float(metric.compute()) == pytest.approx(np.mean(scores), abs=1e-12)
    metric.reset()
    assert metric.last is None
    assert metric.higher_is_better
    assert not metric.is_differentiable


def test_metric_takes_histograms_and_events_alike(backbone, make_events):
    from eqs.metrics import group_chunks

    a, b = make_events(1), make_events(2)
    chunks, _ = group_chunks([b, a], BASE, start_us=0, stop_us=1_000_000)
    histograms = torch.cat(list(chunks))
    metric = EventQualityScore(Judge.of(backbone, bins=2))
    metric.update(a, b, 0, 1_000_000)
    metric.update(histograms[:, 1], histograms[:, 0])
    assert float(metric.compute()) == pytest.approx(metric.last.score, abs=1e-9)


def test_forward_gives_the_sequence_and_keeps_the_mean(backbone, make_events):
    metric = EventQualityScore(Judge.of(backbone, bins=2))
    first = float(metric(make_events(1), make_events(2)))
    second = float(metric(make_events(3), make_events(3)))
    assert second == pytest.approx(1, abs=1e-6)
    assert float(metric.compute()) == pytest.approx((first + second) / 2, abs=1e-9)


def test_silence_has_a_documented_score(backbone, make_events):
    metric = EventQualityScore(Judge.of(backbone, bins=2))
    empty = Events.empty(20, 28)
    metric.update(empty, make_events(1))
    assert metric.last.score == pytest.approx(0, abs=1e-6)
    metric.update(empty, empty, 0, 200_000)
    assert metric.last.score == 1


def test_refusals_of_the_metric(backbone, make_events, tmp_path):
    metric = EventQualityScore(Judge.of(backbone, bins=2))
    with pytest.raises(ValueError, match="one sensor size, got 28x20 and 30x20"):
        metric.update(make_events(1, width=30), make_events(2))
    with pytest.raises(ValueError, match="overlap in time"):
        metric.update(make_events(1), make_events(2).shifted(5_000_000))
    judge = Judge.of(backbone, bins=2)
    with pytest.raises(ValueError, match=r"for centred features, got one without; set eqs\.judge"):
        EventQualityScore(judge, features="centred")
    with pytest.raises(ValueError, match="Expected 2 bins, as the judge was trained with, got 5"):
        EventQualityScore(judge, bins=5)
    with pytest.raises(ValueError, match="Unexpected keyword arguments: `pach_size`"):
        EventQualityScore(judge, pach_size=2)
    with pytest.raises(ValueError, match=r"stages up to 3, got \(1, 4\)"):
        EventQualityScore(judge, stages=(1, 4)).update(make_events(1), make_events(1))


@pytest.mark.filterwarnings("ignore:The ``compute`` method:UserWarning")
def test_compute_needs_an_update(backbone):
    with pytest.raises(ValueError, match="at least one update"):
        EventQualityScore(Judge.of(backbone)).compute()


def test_broken_weights_are_never_a_silent_nan(backbone, make_events):
    with torch.no_grad():
        backbone.convolutions[1].weight[0] = torch.nan
    with pytest.raises(ValueError, match=r"finite features, got NaN or infinity; set eqs.judge"):
        score_streams(backbone, make_events(1), [make_events(2)], readings("hidden"))
    with pytest.raises(ValueError, match="finite features"):
        feature_centres(backbone, [make_events(1)], taps=["hidden"], definition=BASE)


def test_readings_must_share_a_pass(backbone, make_events):
    ways = [*readings("gate"), Reading(definition=replace(BASE, state="reset"))]
    with pytest.raises(ValueError, match="differ in tap, features, distance, patch, patch_size"):
        score_streams(backbone, make_events(1), [make_events(2)], ways)
    ways = [*readings("gate"), Reading(definition=replace(BASE, tap="gate", patch_size=2))]
    with pytest.raises(ValueError, match="of different names"):
        score_streams(backbone, make_events(1), [make_events(2)], ways)


def test_centre_belongs_to_its_tap(centres):
    with pytest.raises(ValueError, match="centre of tap gate, got one of hidden"):
        Reading(definition=replace(BASE, tap="gate", features="centred"), centre=centres["hidden"])


@pytest.mark.parametrize("change", [{"patch_size": 2}, {"state": "reset"}, {"count_cutoff": 3}])
def test_a_centre_belongs_to_features_made_alike(centres, tmp_path, change):
    centres["hidden"].save(tmp_path / "centre.npz")
    loaded = Centre.load(tmp_path / "centre.npz")
    whole = replace(BASE, features="centred")
    for fits in (whole, replace(whole, stages=(1, 2), mask="active", warmup_windows=0)):
        assert Reading(definition=fits, centre=loaded).centre is loaded
    with pytest.raises(ValueError, match=r"pooled and binned as these are, got one of others"):
        Reading(definition=replace(whole, **change), centre=loaded)


def test_a_centre_has_statistics_for_every_stage(centres):
    whole = centres["hidden"]
    with pytest.raises(ValueError, match=r"no covariances, for 3 stages, got 3 and 2"):
        replace(whole, covariances=whole.covariances[:2])


def test_whitened_features_need_covariances(centres, tmp_path):
    whole = centres["hidden"]
    alone = Centre(tap="hidden", stages=(1, 2, 3), means=whole.means)
    alone.save(tmp_path / "means.npz")
    loaded = Centre.load(tmp_path / "means.npz")
    assert loaded.sha256 == alone.sha256 != whole.sha256
    Reading(definition=replace(BASE, features="centred"), centre=loaded)
    with pytest.raises(ValueError, match=r"with covariances .*, got means alone; compute the"):
        Reading(definition=replace(BASE, features="whitened"), centre=loaded)


def test_whitening_comes_before_the_cosine(backbone, centres):
    real, simulated = torch.randint(0, 4, (2, 6, 4, 16, 24)).to(torch.uint8)
    definition = replace(BASE, features="whitened", warmup_windows=0)
    reading = Reading(definition=definition, centre=centres["hidden"])
    (scores,) = score_streams(backbone, real, [simulated], [reading], chunk_windows=4)
    maps, _ = backbone.taps(torch.stack([real, simulated], dim=1).float(), None)
    by_stage = []
    for index, stage in enumerate(maps["hidden"]):
        mean, covariance = (
            torch.from_numpy(part[index]).double()
            for part in (centres["hidden"].means, centres["hidden"].covariances)
        )
        centred = pool_patches(stage).double() - mean[:, None, None]
        white = torch.einsum("dc,tscij->tsdij", whitening_matrix(covariance), centred)
        by_stage.append(torch.cosine_similarity(white[:, 0], white[:, 1], dim=1).mean().item())
    assert scores["hidden_whitened"].by_stage == pytest.approx(by_stage, abs=1e-5)


def test_a_centre_of_few_features_still_whitens(backbone, make_events):
    one_window = torch.randint(0, 4, (1, 4, 32, 24)).to(torch.uint8)  # two patches in stage 3
    few = feature_centres(backbone, [one_window], taps=["hidden"], definition=BASE)["hidden"]
    assert np.linalg.matrix_rank(few.covariances[2]) < len(few.means[2])
    reading = Reading(definition=replace(BASE, features="whitened"), centre=few)
    same, other = score_streams(
        backbone, make_events(1), [make_events(1), make_events(2)], [reading]
    )
    assert same["hidden_whitened"].score == pytest.approx(1, abs=1e-6)
    assert -1 <= other["hidden_whitened"].score < 0.999


def test_centre_is_the_mean_and_covariance_of_pooled_features_after_warmup(backbone):
    recordings = [torch.randint(0, 4, (n, 4, 16, 24)).to(torch.uint8) for n in (8, 3)]
    centre = feature_centres(
        backbone, recordings, taps=["hidden"], definition=BASE, chunk_windows=1
    )["hidden"]
    for stage in range(3):
        kept = [
            pool_patches(backbone.taps(recording[:, None].float(), None)[0]["hidden"][stage])[skip:]
            for recording, skip in zip(recordings, (2, 0), strict=True)
        ]
        vectors = torch.cat([part.movedim(2, -1).flatten(0, -2) for part in kept])
        np.testing.assert_allclose(centre.means[stage], vectors.mean(0).detach(), atol=1e-6)
        expected = np.cov(vectors.detach().double().numpy().T, bias=True)
        np.testing.assert_allclose(centre.covariances[stage], expected, atol=1e-6)


def test_centre_survives_a_file(centres, tmp_path):
    centres["gate"].save(tmp_path / "judge" / "gate.npz")
    loaded = Centre.load(tmp_path / "judge" / "gate.npz")
    assert loaded.sha256 == centres["gate"].sha256 != centres["hidden"].sha256
    assert loaded.patches == centres["gate"].patches > 0
    for before, after in zip(centres["gate"].covariances, loaded.covariances, strict=True):
        np.testing.assert_array_equal(before, after)
    assert [path.name for path in (tmp_path / "judge").iterdir()] == ["gate.npz"]


def test_damaged_centres_are_refused(centres, tmp_path):
    path = tmp_path / "centre.npz"
    centres["gate"].save(path)
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(ValueError, match="Expected a centre written by this package"):
        Centre.load(path)
    np.savez(path, tap="gate", patches=1, sha256="0", stage_1=np.zeros(3, np.float32))
    with pytest.raises(ValueError, match="to match its hash"):
        Centre.load(path)


def test_centre_of_fewer_stages_is_refused(backbone, make_events, centres):
    whole = centres["hidden"]
    short = Centre(tap="hidden", stages=(1,), means=whole.means[:1])
    judge = replace(Judge.of(backbone, bins=2), centres=(short,))
    with pytest.raises(ValueError, match=r"centre of stages \(1, 2, 3\), got one of \(1,\)"):
        EventQualityScore(judge, features="centred").update(make_events(1), make_events(1))


def test_centres_need_a_recording(backbone):
    with pytest.raises(ValueError, match="at least one real recording"):
        feature_centres(backbone, [], taps=["hidden"], definition=BASE)


def test_the_headline_is_the_agreement_of_what_silence_leaves(backbone):
    real, simulated = torch.randint(0, 4, (2, 9, 4, 16, 24)).to(torch.uint8)
    (scores,) = score_streams(
        backbone, real, [simulated], [Reading(definition=HEADLINE)], chunk_windows=4
    )
    streams = torch.stack([real, simulated, torch.zeros_like(real)], dim=1).float()
    maps, _ = backbone.taps(streams, None)
    by_stage = []
    for stage in maps["hidden"]:
        a, b = (stage[2:, k].double() - stage[2:, 2].double() for k in (0, 1))
        products = 2 * (a * b).sum(dim=(1, 2, 3))
        by_stage.append((products / (a * a + b * b).sum(dim=(1, 2, 3))).mean().item())
    score = scores["hidden_silence"]
    assert score.by_stage == pytest.approx(by_stage, abs=1e-6)
    assert score.curve[2:].mean() == pytest.approx(score.score, abs=1e-12)
    assert score.patch_px == 2
    assert score.map.shape == (8, 12)


def test_the_response_to_silence_is_that_of_the_last_of_the_warm_up_from_then_on(backbone):
    real, simulated = torch.randint(0, 4, (2, 16, 4, 16, 24)).to(torch.uint8)
    definition = replace(HEADLINE, warmup_windows=3)
    responses = Silence(backbone).responses([definition], (16, 24), 0, 16)[definition.maps]
    for stage in responses:
        assert len(stage) == 16
        assert (stage[3] == stage[3:]).all()
        assert not torch.equal(stage[2], stage[3])
    late = Silence(backbone).responses([definition], (16, 24), 2, 5)[definition.maps]
    torch.testing.assert_close(late[0], responses[0][2:7])
    (scores,) = score_streams(backbone, real, [simulated], [Reading(definition=definition)])
    assert scores["hidden_silence"].warmup == 3


def test_more_of_everything_is_seen(backbone):
    """Features twice as far from silence have the same direction, but agree less."""

    class Louder:
        """The second stream moves the state, from where silence leaves it, twice as far."""

        strides = backbone.strides

        def taps(self, x, states, stages, names):
            maps, states = backbone.taps(x, states, stages=stages, names=names)
            quiet, _ = backbone.taps(torch.zeros_like(x), None, stages=stages, names=names)
            for stage, silent in zip(maps["hidden"], quiet["hidden"], strict=True):
                stage[:, 1:] = silent[:, 1:] + 2 * (stage[:, 1:] - silent[:, 1:])
            return maps, states

    real = torch.randint(0, 4, (8, 4, 16, 24)).to(torch.uint8)
    ways = [Reading(definition=HEADLINE)]
    with torch.no_grad():
        (scores,) = score_streams(Louder(), real, [real], ways)
    assert scores["hidden_silence"].score == pytest.approx(0.8, abs=1e-6)


def test_windows_in_which_both_are_silent_do_not_count(backbone):
    real, simulated = torch.randint(0, 4, (2, 6, 4, 16, 24)).to(torch.uint8)
    real[:3] = simulated[:3] = 0
    definition = replace(HEADLINE, warmup_windows=0, state="reset")
    (scores,) = score_streams(backbone, real, [simulated], [Reading(definition=definition)])
    found = scores["hidden_silence"]
    assert np.isnan(found.curve).tolist() == [True] * 3 + [False] * 3
    (alone,) = score_streams(backbone, real[3:], [simulated[3:]], [Reading(definition=definition)])
    assert found.score == pytest.approx(alone["hidden_silence"].score, abs=1e-6)
