"""Every public function and method with arguments that it accepts, of which some are replaced by hostile
ones."""

import importlib
import inspect
import pathlib

import numpy as np

import jacoflow
from jacoflow import filters, io, mixture, motion3d, plot, scenes, segment, stereo, track

import values

MODULES = ["jacoflow", "jacoflow.io", "jacoflow.filters", "jacoflow.mixture", "jacoflow.motion3d", "jacoflow.plot", "jacoflow.scenes", "jacoflow.segment", "jacoflow.stereo", "jacoflow.track", "jacoflow.video"]  # fmt: skip
RESULTS = {"EdgeDisparity", "FieldLike", "FrameReader", "GaussianFilter", "LateralBound", "LateralEstimate", "MotionBound", "MotionEstimate", "MotionSolution", "MovingTarget", "Observability", "ObservabilityMap", "ParticleCorners", "ParticleStep", "ParticleTrack", "ParticleTracks", "StereoCluster", "StereoStep", "StereoTrack", "SystematicEffect", "Track", "TrackResult"}  # fmt: skip
"""Classes that only the library makes."""
ENUMERATIONS = {"Condition", "Status"}


def public():
    """Names of all public functions and classes but results, enumerations and errors."""
    found = set()
    for name in MODULES:
        module = importlib.import_module(name)
        for each in module.__all__:
            value = getattr(module, each)
            if callable(value) and each not in RESULTS | ENUMERATIONS and not (inspect.isclass(value) and issubclass(value, Exception)):
                found.add(f"{name.removeprefix('jacoflow').removeprefix('.')}.{each}".lstrip("."))
    return found


def point_set():
    rng = np.random.default_rng(4)
    points = rng.uniform(-0.5, 0.5, (30, 2))
    depths, u, w = rng.uniform(0.5, 1.5, 30), np.array([0.6, 0.2, 0.75]) / np.linalg.norm([0.6, 0.2, 0.75]), np.array([0.02, -0.03, 0.01])
    return points, motion3d.predict_flow(points, u, w, depths), depths, u, w


class Recipes:
    """Calls by name: what is called, and good arguments."""

    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        scene = scenes.Scene("affine", width=32, height=24, random_state=1)
        self.frames = [scenes.Sensor(noise=1.0).apply_u8(frame, t) for t, frame in enumerate(scene.frames(4))]
        self.field = jacoflow.flow(*self.frames[:3])
        self.colour = scenes.TargetScene("people_static", scale=0.1, frames=4)
        self.all = {**self.of_flow(scene), **self.of_files(), **self.of_filters(), **self.of_points(), **self.of_views(), **self.of_targets(), **self.of_pictures()}

    def of_flow(self, scene):
        first, second, third, _ = self.frames
        common = {"grid": jacoflow.SamplingGrid(stride=2), "mask": np.ones((24, 32), bool), "preprocess": jacoflow.Preprocess(smooth=1.0), "fps": 25.0, "pixel_pitch": 1.0, "precision": "float32", "threads": 2, "simd": "scalar"}  # fmt: skip
        estimate = {**common, "method": "windowed", "initial": np.zeros((24, 32, 2)), "temporal": "none", "covariance": True, "noise": 1.0, "diagnostics": True}
        field = self.field
        return {
            "estimate": (jacoflow.estimate, {"frames": self.frames[:3]}, {**estimate, "ends": "drop", "pairs": False, "progress": None}),
            "flow": (jacoflow.flow, {"first": first, "second": second}, {"third": third, **estimate}),
            "FlowEstimator": (jacoflow.FlowEstimator, {}, estimate),
            "FlowEstimator.push": (jacoflow.FlowEstimator(method="windowed").push, {"frame": first}, {"time": 1.0}),
            "FlowFilter": (jacoflow.FlowFilter, {}, {**common, "profile": jacoflow.FilterProfile()}),
            "FlowFilter.push": (jacoflow.FlowFilter().push, {"frame": first}, {}),
            "FlowField.advect": (field.advect, {"points": np.array([[5.0, 6.0], [9.5, 7.5]])}, {"covariance": np.array([np.eye(2)] * 2)}),
            "FlowField.value": (field.value, {"name": "curl"}, {}),
            "FlowField.std": (field.std, {"name": "curl"}, {}),
            "FlowField.region_mean": (field.region_mean, {"name": "curl"}, {"region": (2, 2, 9, 9), "aggregate": "mean"}),
            "Measurement": (field.measure, {"name": "curl"}, {"region": (9.0, 9.0, 5.0), "at": (9.0, 9.0)}),
            "FlowField.unit": (field.unit, {"name": "curl"}, {}),
            "FlowField": (jacoflow.FlowField.from_arrays, {"flow": np.zeros((24, 32, 2))}, {"covariance": np.ones((24, 32, 2, 2)), "jacobian": np.zeros((24, 32, 2, 2))}),
            "classify": (jacoflow.classify, {"jet": np.ones(9), "motion": np.zeros(6)}, {}),
            "observability": (jacoflow.observability, {"frames": self.frames[:3]}, {"time_scheme": "central", "neighbourhood": (3, 3)}),
            "corners": (jacoflow.corners, {"frame": first}, {"max_count": 5, "quality": 0.1, "min_distance": 2.0, "window": 3, "existing": np.zeros((1, 2)), "threads": 1}),
            "point_flow": (jacoflow.point_flow, {"before": first, "after": second, "points": np.array([[9.0, 9.0]])}, {"guesses": np.zeros((1, 2)), "levels": 2, "window": 5, "max_steps": 5, "min_step": 0.1, "forward_backward": 0.7, "min_eigenvalue": 0.1, "threads": 1}),
            "luminance": (jacoflow.luminance, {"frame": first}, {}),
            "quantise": (jacoflow.quantise, {"frame": first}, {"step": 2.0}),
            "smooth": (jacoflow.smooth, {"frame": first, "blur_sigma": 1.0}, {"truncate": 3.0, "threads": 1}),
            "quantities": (jacoflow.quantities, {}, {}),
            "CoarseToFine": (lambda **options: jacoflow.flow(first, second, third, method=jacoflow.CoarseToFine(**options)), {}, {"preset": "fast", "levels": 2, "time_scheme": "central"}),
            "Windowed": (lambda **options: jacoflow.flow(first, second, third, method=jacoflow.Windowed(**options)), {}, {"window_sigma": 2.0, "rows": "all", "neighbourhood": (3, 3), "time_scheme": "central"}),
            "Instantaneous": (lambda **options: jacoflow.flow(first, second, third, method=jacoflow.Instantaneous(**options)), {}, {"model": "affine", "neighbourhood": (3, 3)}),
            "LucasKanade": (lambda **options: jacoflow.flow(first, second, method=jacoflow.LucasKanade(**options)), {}, {"window_sigma": 2.0, "time_scheme": "pair"}),
            "HornSchunck": (lambda **options: jacoflow.flow(first, second, method=jacoflow.HornSchunck(**options)), {}, {"smoothness": 2.0, "iterations": 5, "time_scheme": "pair"}),
            "Recursive": (lambda **options: jacoflow.estimate(self.frames, method="windowed", temporal=jacoflow.Recursive(**options)), {}, {"forgetting": 0.9}),
            "SamplingGrid": (lambda **options: jacoflow.flow(first, second, third, method="windowed", grid=jacoflow.SamplingGrid(**options)), {}, {"region": (1, 1, 9, 9), "stride": 2}),
            "Preprocess": (lambda **options: jacoflow.flow(first, second, third, method="windowed", preprocess=jacoflow.Preprocess(**options)), {}, {"quantise": 2.0, "smooth": 1.0, "colour": "luminance"}),
            "FilterProfile": (lambda **options: jacoflow.FlowFilter(profile=jacoflow.FilterProfile(**options)).push(first), {}, {"name": "patent", "form": "fast", "transition": "exact", "neighbourhood": (3, 3), "Q": np.ones(12), "R": 1.0, "x0": np.zeros(12), "P0": np.ones(12), "alpha": 1.0}),
            "scenes.Scene": (lambda **options: scenes.Scene(**options).frame(0.0), {"name": "waves", "width": 9, "height": 8}, {"origin": (0.0, 0.0), "random_state": 3, "speed": 1.0, "wavelength": 30.0}),
            "scenes.Scene.frame": (scene.frame, {"t": 1.0}, {}),
            "scenes.Scene.frames": (scene.frames, {"count": 2}, {"start": 0.0}),
            "scenes.Scene.truth": (scene.truth, {"t": 1.0}, {"between": (0.0, 1.0)}),
            "scenes.Scene.motion": (scene.motion, {"x": 1.0, "y": 2.0, "t": 0.0}, {}),
            "scenes.Scene.displacement": (scene.displacement, {"x": 1.0, "y": 2.0, "t": 0.0}, {"duration": 1.0}),
            "scenes.Sensor": (lambda **options: scenes.Sensor(**options).apply_u8(first), {}, {"noise": 1.0, "rounding": "floor", "saturate": True, "random_state": 1}),
            "scenes.Sensor.apply": (scenes.Sensor().apply, {"frame": first}, {"index": 1}),
            "scenes.TargetScene": (scenes.TargetScene, {"name": "people_static", "scale": 0.1}, {"random_state": 1, "noise": 1.0, "frames": 3, "colour_cast": 0.1}),
            "scenes.TargetScene.frame": (self.colour.frame, {"t": 1}, {"targets": [0]}),
            "scenes.names": (scenes.names, {}, {}),
            "scenes.carriers": (scenes.carriers, {}, {}),
            "scenes.target_scenes": (scenes.target_scenes, {}, {}),
            "scenes.parameters": (scenes.parameters, {"name": "waves"}, {}),
        }  # fmt: skip

    def of_files(self):
        flow, path = np.zeros((24, 32, 2), np.float32), self.folder / "made"
        stack = jacoflow.estimate(np.array(self.frames), method="windowed")
        writers = {
            "io.write_flo": (io.write_flo, {"path": f"{path}.flo", "flow": flow}, {}),
            "io.write_kitti": (io.write_kitti, {"path": f"{path}.png", "flow": flow}, {}),
            "io.write_pfm": (io.write_pfm, {"path": f"{path}.pfm", "values": flow[..., 0]}, {}),
            "io.write_npz": (io.write_npz, {"path": f"{path}.npz", "field": self.field}, {"options": "{}"}),
            "io.write_disparity": (io.write_disparity, {"path": f"{path}_d.npz", "disparity": flow[..., 0]}, {}),
            "io.write_frames": (io.write_frames, {"path": f"{path}.npy", "frames": self.frames}, {"frame_rate": 25.0}),
            "FlowField.save": (stack.save, {"path": f"{path}_fields"}, {"options": ""}),
        }
        readers = {name: (getattr(io, name.split(".")[1]), {"path": f"{path}.none"}, {}) for name in ("io.read_flo", "io.read_kitti", "io.read_pfm", "io.read_npz", "io.read_disparity", "io.read_image")}
        video = importlib.import_module("jacoflow.video")
        return {
            **writers,
            **readers,
            "io.frames": (io.frames, {"source": f"{path}.none"}, {"colour": "luminance", "grey": "repeat", "start": 0, "stop": 3, "step": 1}),
            "video.frames": (lambda **options: next(iter(video.frames(**options)), None), {"path": f"{path}.none"}, {"start": 0, "stop": 3, "step": 1, "grey": "luma"}),
            "video.Video": (video.Video, {"path": f"{path}.none"}, {"start": 0, "stop": 3, "step": 1, "grey": "luma"}),
        }

    def of_filters(self):
        def kalman(method):
            def call(**arguments):
                made = filters.KalmanFilter(2, 1)
                made.H = np.array([[1.0, 0.0]])
                return getattr(made, method)(**arguments)

            return call

        def setting(**attributes):
            made = filters.KalmanFilter(2, 1)
            for name, value in attributes.items():
                setattr(made, name, value)

        points = filters.MerweScaledSigmaPoints(2)
        unscented = {"dim_x": 2, "dim_z": 1, "dt": 1.0, "hx": lambda x, *_: x[:, :1], "fx": lambda x, *_: x, "points": points}
        rows = np.random.default_rng(0).normal(size=(40, 2))
        of_mixture = {"n_components": 2, "max_iter": 3, "n_init": 1, "tol": 1e-3, "random_state": 0, "threads": 1, "covariance_prior": 1.0}
        fit = {"X": rows}
        variational, dirichlet = mixture.VariationalGaussianMixture, mixture.DirichletProcessGaussianMixture
        return {
            "filters.KalmanFilter": (filters.KalmanFilter, {"dim_x": 2, "dim_z": 1}, {"batch": 3}),
            "filters.KalmanFilter.predict": (kalman("predict"), {}, {"F": np.eye(2), "Q": np.eye(2)}),
            "filters.KalmanFilter.update": (kalman("update"), {"z": np.zeros(1)}, {"R": np.eye(1), "H": np.ones((1, 2))}),
            "filters.KalmanFilter.set": (setting, {}, {"x": np.zeros(2), "P": np.eye(2), "Q": np.eye(2), "R": np.eye(1), "F": np.eye(2), "H": np.ones((1, 2))}),
            "filters.ExtendedKalmanFilter": (filters.ExtendedKalmanFilter, {"dim_x": 2, "dim_z": 1}, {"batch": 3}),
            "filters.UnscentedKalmanFilter": (lambda **options: filters.UnscentedKalmanFilter(**options).predict(), unscented, {"batch": 3, "augmented": True, "redraw": False}),
            "filters.MerweScaledSigmaPoints": (filters.MerweScaledSigmaPoints, {"n": 2}, {"alpha": 0.5, "beta": 2.0, "kappa": 1.0}),
            "filters.MerweScaledSigmaPoints.sigma_points": (points.sigma_points, {"x": np.zeros(2), "P": np.eye(2)}, {}),
            "filters.ParticleFilter": (filters.ParticleFilter, {"dim_x": 2, "n_particles": 8}, {"batch": 2, "random_state": 1, "ids": [1], "threads": 1}),
            "filters.ParticleFilter.update": (lambda **options: filters.ParticleFilter(2, 8).update(**options), {"log_likelihood": np.zeros(8)}, {}),
            "filters.ParticleFilter.predict": (lambda **options: filters.ParticleFilter(2, 8).predict(**options), {"F": np.eye(2)}, {"Q": np.eye(2)}),
            "filters.ParticleFilter.resample": (lambda **options: filters.ParticleFilter(2, 8).resample(**options), {}, {"scheme": "systematic", "threshold": 0.5, "n_particles": 9}),
            "filters.resample": (filters.resample, {"weights": np.ones(5)}, {"n": 4, "scheme": "residual", "uniforms": None, "random_state": 1}),
            "mixture.VariationalGaussianMixture": (lambda **options: variational(**options).fit(rows), {"n_components": 2, "max_iter": 3}, {**of_mixture, "weight_concentration_prior": 0.1, "mean_prior": np.zeros(2), "init": "random", "prune_weight": 0.0}),
            "mixture.VariationalGaussianMixture.fit": (lambda **options: variational(2, max_iter=3).fit(**options), fit, {"y": None, "sample_weight": np.ones(40), "resp": np.ones((40, 2)) / 2}),
            "mixture.VariationalGaussianMixture.partial_fit": (lambda **options: variational(2, max_iter=3).partial_fit(**options), fit, {"sample_weight": np.ones(40), "forgetting": 0.9}),
            "mixture.VariationalGaussianMixture.predict": (variational(2, max_iter=3).fit(rows).predict_proba, fit, {}),
            "mixture.DirichletProcessGaussianMixture": (lambda **options: dirichlet(**options).fit(rows), {"n_components": 2, "max_iter": 3}, {**of_mixture, "weight_concentration": 1.0, "inference": "vb", "merge": False, "covariance_floor": 1e-6}),
            "mixture.DirichletProcessGaussianMixture.fit": (lambda **options: dirichlet(2, max_iter=3).fit(**options), fit, {"sample_weight": np.ones(40), "resp": np.ones((40, 2)) / 2}),
        }  # fmt: skip

    def of_points(self):
        points, flow, depths, u, w = point_set()
        camera = np.array([[30.0, 0.0, 16.0], [0.0, 30.0, 12.0], [0.0, 0.0, 1.0]])
        estimate = {"points": points, "flow": flow}
        found = motion3d.estimate_motion(points, flow, placement="start")
        options = {"K": camera, "noise_std": 1e-3, "cov": np.array([np.eye(2)] * 30), "jacobian": np.zeros((30, 2, 2)), "projection": "plane", "method": "ml", "robust": True, "placement": "start", "smoother": "prior", "weight_inv_depth": depths, "rotation_prior": (w, np.eye(3)), "initial": (u, w), "points_per_independent_sample": 2.0, "correlation_length": 0.1, "flow_scale_std": 0.1, "flow_bias_std": 0.1, "random_state": 3, "threads": 1}  # fmt: skip
        bound = {"points": points, "translation": u, "rotation": w, "inv_depth": depths}
        return {
            "motion3d.estimate_motion": (motion3d.estimate_motion, estimate, options),
            "motion3d.estimate_field_motion": (motion3d.estimate_field_motion, {"field": self.field, "K": camera}, {"spacing": 3.0, "max_points": 30, "region": (2, 2, 20, 20), "object_rotation_std": 0.1, "patches": 4}),
            "motion3d.estimate_lateral": (motion3d.estimate_lateral, {"flow": flow}, {"noise_std": 0.1, "weights": "ml"}),
            "motion3d.motion_bound": (motion3d.motion_bound, {**bound, "noise_std": 0.1}, {"K": camera, "cov": np.array([np.eye(2)] * 30), "jacobian": False, "projection": "plane"}),
            "motion3d.predict_flow": (motion3d.predict_flow, bound, {"K": camera, "projection": "plane", "whole_frame": True}),
            "motion3d.lateral_bound": (motion3d.lateral_bound, {"inv_depth": depths, "noise_std": 0.1}, {}),
            "motion3d.essential_matrix": (motion3d.essential_matrix, {"result": found}, {}),
            "motion3d.focus_of_expansion": (motion3d.focus_of_expansion, {"result": found}, {"K": camera}),
            "motion3d.time_to_contact": (motion3d.time_to_contact, {"result": found}, {}),
            "motion3d.time_to_contact_std": (motion3d.time_to_contact_std, {"result": found}, {}),
            "motion3d.time_to_contact_map": (motion3d.time_to_contact_map, {"field": self.field, "result": found, "K": camera}, {"placement": "start"}),
        }

    def of_views(self):
        left, right = self.frames[0], self.frames[1]
        search = {"disparity_range": (-4, 4), "row_range": (-1, 1), "blur_sigma": 1.0, "threshold": 2.0, "classes": 8, "window": 5, "min_support": 0.3, "threads": 1}
        tracker = {"n_components": 2, "disparity_range": (-4, 4), "row_range": (-1, 1), "row_offset": 0.0, "grid": (6, 8, None), "search": 2, "camera": track.StereoCamera(30.0, 1.0), "step_time": 1.0, "random_state": 1, "threads": 1}
        return {
            "stereo.edge_disparity": (stereo.edge_disparity, {"left": left, "right": right}, {**search, "row_offset": 0.0, "method": "classes", "subpixel": False, "left_right_check": False, "prior": np.zeros((24, 32)), "prior_radius": 2}),
            "stereo.edge_pixels": (stereo.edge_pixels, {"view": left}, {"blur_sigma": 1.0, "threshold": 2.0, "threads": 1}),
            "stereo.estimate_row_offset": (stereo.estimate_row_offset, {"left": left, "right": right}, search),
            "track.StereoTracker": (lambda **options: track.StereoTracker(**options).update(left, right), {"grid": (6, 8, None), "n_components": 2}, tracker),
            "track.StereoTracker.update": (track.StereoTracker(grid=(6, 8, None), n_components=2).update, {"left": left, "right": right}, {"dt": 1.0}),
            "track.StereoTracker.update_disparity": (track.StereoTracker(grid=(6, 8, None), n_components=2).update_disparity, {"left": left, "disparity": np.full((24, 32), np.nan)}, {"dt": 1.0}),
            "track.StereoCamera": (track.StereoCamera, {"focal": 30.0, "baseline": 1.0}, {"d_infinity": 0.0}),
            "track.TrackGraph": (track.TrackGraph.from_json, {"text": track.TrackGraph().to_json()}, {}),
            "track.TrackGraph.follow": (track.TrackGraph().follow, {"t": 0, "k": 0}, {"threshold": 0.4, "backward": False}),
            "segment.felzenszwalb": (segment.felzenszwalb, {"image": left}, {"scale": 10.0, "sigma": 0.8, "min_size": 5, "threads": 1}),
            "segment.region_means": (segment.region_means, {"labels": np.zeros((24, 32), int), "values": left}, {}),
        }  # fmt: skip

    def of_targets(self):
        first, second, box = self.frames[0], self.frames[1], (5.0, 5.0, 9.0, 9.0)
        colour, boxes = self.colour.frame(0), self.colour.boxes()[0]
        particle = {"mode": "paper", "n_particles": 8, "n_near": 8, "scale": 0.1, "likelihoods": ["colour"], "resampling": "residual", "ess_threshold": 0.5, "foreground": "affine", "segmentation": {"scale": 150.0}, "grey": "value", "random_state": 1, "threads": 1}
        return {
            "track.GradientTracker": (track.GradientTracker, {"frame": first, "bbox": box}, {"center": None, "model": "affine", "camera": "none"}),
            "track.GradientTracker.update": (track.GradientTracker(first, box).update, {"frame": second}, {}),
            "track.track": (track.track, {"frames": [first, second], "bbox": box}, {"model": "affine"}),
            "track.detect_moving_target": (track.detect_moving_target, {"first": first, "second": second}, {"center": (9.0, 9.0)}),
            "track.GaussMarkovFilter": (track.GaussMarkovFilter, {"position": (1.0, 2.0)}, {"alpha": 0.8, "q": 0.5, "start": (1.0, 4.0, 1.0), "measures": "instant"}),
            "track.GaussMarkovFilter.update": (track.GaussMarkovFilter((1.0, 2.0)).update, {}, {"position": (1.0, 1.0), "velocity": (0.0, 0.0), "position_variance": 1.0, "velocity_variance": 1.0}),
            "track.ParticleTracker": (track.ParticleTracker, {"frame": colour, "boxes": boxes, "n_particles": 8, "n_near": 8}, particle),
            "track.ParticleTracker.update": (track.ParticleTracker(colour, boxes, n_particles=8, n_near=8).update, {"frame": self.colour.frame(1)}, {"camera": np.eye(2, 3)}),
            "track.ParticleTracker.add": (lambda **options: track.ParticleTracker(colour, boxes, n_particles=8, n_near=8).add(**options), {"box": boxes[0]}, {"id": 9}),
            "track.ParticleTracker.remove": (lambda **options: track.ParticleTracker(colour, boxes, n_particles=8, n_near=8).remove(**options), {"id": 0}, {}),
            "track.track_particles": (track.track_particles, {"frames": [colour, self.colour.frame(1)], "boxes": boxes, "n_particles": 8, "n_near": 8}, {"keep_frames": True, "keep_particles": True}),
        }  # fmt: skip

    def of_pictures(self):
        found = stereo.edge_disparity(self.frames[0], self.frames[1], disparity_range=(-4, 4), row_offset=0.0)
        tracker = track.StereoTracker(grid=(6, 8, None), n_components=2)
        step = tracker.update(self.frames[0], self.frames[1])
        field = {"field": self.field}
        return {
            "plot.flow_image": (plot.flow_image, field, {"max_speed": 1.0}),
            "plot.wheel_image": (plot.wheel_image, {}, {"size": 16}),
            "plot.flow_colour": (plot.flow_colour, field, {"max_speed": 1.0, "legend": False}),
            "plot.quiver": (plot.quiver, field, {"frame": self.frames[0], "step": 4, "scale": 1.0}),
            "plot.scalar_map": (plot.scalar_map, {"values": np.zeros((24, 32))}, {"field": self.field, "limit": 1.0, "signed": False}),
            "plot.divergence": (plot.divergence, field, {"limit": 1.0}),
            "plot.curl": (plot.curl, field, {"limit": 1.0}),
            "plot.overview": (plot.overview, field, {"frame": self.frames[0]}),
            "plot.disparity": (plot.disparity, {"found": found}, {"left": self.frames[0], "limits": (0.0, 1.0)}),
            "plot.clusters": (plot.clusters, {"step": step}, {"left": self.frames[0], "by": "group", "arrows": 1.0}),
            "plot.track_graph": (plot.track_graph, {"graph": tracker.graph}, {"threshold": 0.4}),
        }

    def pick(self, rng):
        """Name, function and arguments of a call: one or two are hostile."""
        name = rng.choice(sorted(self.all))
        function, needed, options = self.all[name]
        given = {**needed, **{key: value for key, value in options.items() if rng.random() < 0.2}}
        names = sorted({*needed, *options})
        for key in rng.sample(names, min(len(names), rng.choice([1, 1, 1, 2]))):
            # A path is where a file is written: only places in the folder, and words that name none.
            good = {**needed, **options}[key]
            given[key] = rng.choice([None, 3, "", "\0", b"x", self.folder, f"{self.folder}/no/x.flo", values.Path()]) if key == "path" else values.hostile(rng, good)
        if needed and rng.random() < 0.03:
            given.pop(rng.choice(sorted(needed)), None)
        return name, function, given
