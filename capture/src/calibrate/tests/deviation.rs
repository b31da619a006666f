//! Deviations told, against the errors of films taken again and again.

use super::*;

const DRAWS: u64 = 16;

/// Root of the mean square of errors in deviations told: of the axis (two directions), and of the angles about their mean.
fn errors_in_deviations(film: &Film, options: &CalibrateOptions) -> [f64; 2] {
    let (mut axis, mut angles, mut count) = (0.0, 0.0, 0);
    for seed in 0..DRAWS {
        let result = of_board(&film.sightings(900 + seed), options);
        let turntable = platter(&result);
        let off = turntable.axis_direction.angle(&film.axis.1);
        axis += (off / turntable.axis_deviation.unwrap()).powi(2) / DRAWS as f64;
        let misses: Vec<f64> = turntable.angles.iter().zip(&film.angles).map(|(a, t)| a.unwrap() - t).collect();
        let mean = misses.iter().sum::<f64>() / misses.len() as f64;
        for (miss, deviation) in misses.iter().zip(&turntable.angle_deviations) {
            angles += ((miss - mean) / deviation.unwrap()).powi(2);
            count += 1;
        }
    }
    [axis.sqrt(), (angles / f64::from(count)).sqrt()]
}

#[test]
fn axis_and_angles_are_off_by_as_much_as_told() {
    let film = Film { noise: 0.2, ..Film::new(30.0, 16) };
    for options in [known(), options()] {
        let [axis, angles] = errors_in_deviations(&film, &options);
        println!("axis off by {axis:.2} deviations, angles by {angles:.2}");
        assert!((0.7..1.4).contains(&axis) && (0.85..1.15).contains(&angles), "{axis} {angles}");
    }
}

#[test]
fn half_the_noise_is_half_the_deviation_and_four_turns_tell_the_axis_twice_as_well() {
    let film = Film { dropped: 0.0, ..Film::new(30.0, 12) };
    let told = |film: &Film| platter(&of_board(&film.sightings(40), &known())).axis_deviation.unwrap();
    let usual = told(&film);
    let halved = told(&Film { noise: 0.5 * film.noise, ..film.clone() });
    assert!((halved / usual - 0.5).abs() < 0.01, "{halved} {usual}");
    let more = told(&Film { angles: (0..48).map(|k| TAU * f64::from(k) / 12.0).collect(), ..film });
    assert!((more / usual - 0.5).abs() < 0.05, "{more} {usual}");
}
