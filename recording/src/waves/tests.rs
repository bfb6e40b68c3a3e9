//! Waveforms of instruments, valid and invalid; files written by third-party code (fixtures/make.py).

use proptest::prelude::*;

use super::*;

pub(super) fn parsed(text: &str, options: &Options) -> Result<Waves, Faults> {
    parse(Path::new("a.csv"), text.as_bytes().to_vec(), options)
}

fn at_rate(rate_hz: f64) -> Options {
    Options { rate_hz: Some(rate_hz), ..Options::default() }
}

fn names(record: &Record) -> Vec<&str> {
    record.channels.iter().map(|wave| wave.name.as_str()).collect()
}

fn fixture(name: &str) -> (PathBuf, Vec<u8>) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/waves/fixtures").join(name);
    let bytes = std::fs::read(&path).unwrap();
    (path, bytes)
}

#[test]
fn a_table_with_names_gives_its_channels_units_axes_and_rate() {
    let text = "t_ms;Fx_N;acc y (g);remark;tacho\n0;1,5;2;a;0\n0,5;;3;b;0\n1;2;4;c;1\n";
    let waves = parsed(text, &Options::default()).unwrap();
    let [record] = waves.records.as_slice() else { panic!("{waves:?}") };
    assert_eq!(record.grid, Grid::Time { start_s: 0.0, rate_hz: 2000.0 });
    assert_eq!(names(record), ["Fx_N", "acc y (g)"]);
    assert_eq!((record.channels[0].axis, record.channels[1].axis), (Some(0), Some(1)));
    assert_eq!(record.channels[1].quantity(), Some((Quantity::Acceleration, 9.80665)));
    assert!(record.channels[0].values[1].is_nan(), "a sample that was not taken");
    assert_eq!(record.auxiliary[&Channel::Tacho], [0.0, 0.0, 1.0]);
    assert!(waves.notes.iter().any(|note| note.contains("remark")), "{:?}", waves.notes);
}

#[test]
fn a_table_without_names_counts_time_in_its_first_column_and_is_asked_by_number() {
    let text = "0.000\t1\t5\n0.001\t2\t6\n0.002\t3\t7\n0.003\t4\t8\n";
    let waves = parsed(text, &Options::default()).unwrap();
    assert_eq!(waves.records[0].grid, Grid::Time { start_s: 0.0, rate_hz: 1000.0 });
    assert_eq!(names(&waves.records[0]), ["2", "3"]);
    let third = Options { columns: vec!["3".to_owned()], ..Options::default() };
    let waves = parsed(&text.replace('\t', "  "), &third).unwrap();
    assert_eq!(waves.records[0].channels[0].values, [5.0, 6.0, 7.0, 8.0]);
}

#[test]
fn a_rate_is_needed_where_no_column_tells_time() {
    let text = "n,F\n1,5\n2,6\n3,7\n4,8\n";
    let fault = parsed(text, &Options::default()).unwrap_err();
    assert!(fault.list()[0].settings.contains(&Setting::SamplingRate), "{fault}");
    let waves = parsed(text, &at_rate(500.0)).unwrap();
    assert_eq!(waves.records[0].grid, Grid::Time { start_s: 0.0, rate_hz: 500.0 });
    assert_eq!(names(&waves.records[0]), ["F"]);
    let single = parsed("1\n2\n3\n1\n", &at_rate(500.0)).unwrap();
    assert_eq!(single.records[0].channels[0].values, [1.0, 2.0, 3.0, 1.0]);
    assert!(parsed(text, &at_rate(f64::NAN)).is_err());
    assert!(parsed(text, &at_rate(-1.0)).is_err());
}

#[test]
fn a_profile_stands_over_length() {
    let text = "x_um,z_um\n0,1\n0.25,2\n0.5,3\n0.75,5\n";
    let waves = parsed(text, &Options::default()).unwrap();
    assert_eq!(waves.records[0].grid, Grid::Length { start_mm: 0.0, step_mm: 0.000_25 });
    assert_eq!(waves.records[0].channels[0].quantity(), Some((Quantity::Length, 1e-6)));
    let without_units = "x z\n1 1\n2 2\n4 3\n8 5\n";
    let step = Options { step_mm: Some(0.1), columns: vec!["z".to_owned()], ..Options::default() };
    let waves = parsed(without_units, &step).unwrap();
    assert_eq!(waves.records[0].grid, Grid::Length { start_mm: 0.0, step_mm: 0.1 });
}

#[test]
fn a_gap_splits_a_record_and_jitter_is_reported() {
    let mut text = "t_s,F\n".to_owned();
    for i in 0..40 {
        let late = if i >= 20 { 0.5 } else { 0.0 };
        let jitter = if i % 2 == 0 { 0.0 } else { 0.0001 };
        text += &format!("{},{i}\n", 0.001 * f64::from(i) + late + jitter);
    }
    let waves = parsed(&text, &Options::default()).unwrap();
    let [first, second] = waves.records.as_slice() else { panic!("{waves:?}") };
    assert_eq!((first.len(), second.len()), (20, 20));
    let Grid::Time { start_s, rate_hz } = second.grid else { panic!("{second:?}") };
    assert!((start_s - 0.52).abs() < 1e-9 && (rate_hz - 1000.0).abs() < 10.0, "{rate_hz}");
    let notes = waves.notes.join("\n");
    assert!(notes.contains("gap") && notes.contains("deviate by 9.9 %"), "{notes}");
}

#[test]
fn rows_of_another_instrument_are_left_out_and_single_holes_stay() {
    let mut text = "t_s,q1_deg,fx_N\n".to_owned();
    for i in 0..60 {
        let force = if i % 3 == 0 && i != 30 { i.to_string() } else { String::new() };
        text += &format!("{},{i},{force}\n", 0.001 * f64::from(i));
    }
    let recording = series::read_text("a.csv", &text, None, None, RequiredData::Samples).unwrap();
    let waves = recorded::waves(recording, &Options::default()).unwrap();
    assert_eq!(waves.records.len(), 2, "the sample that is missing is a gap: {:?}", waves.notes);
    let Grid::Time { rate_hz, .. } = waves.records[0].grid else { panic!() };
    assert!((rate_hz - 1000.0 / 3.0).abs() < 1e-6);
    assert_eq!(waves.records[0].auxiliary[&Channel::Command(0)].len(), 10);
}

#[test]
fn a_recording_of_the_house_gives_forces_and_what_stands_beside() {
    let text = "t_s,segment,q1_deg,fx_N,mz_Nm,feed_mm_s,spindle_rpm,sound\n\
        0,1,5,1,2,10,28000,7\n0.001,1,5,3,4,10,28000,8\n0,2,6,5,6,10,28000,\n0.001,2,6,7,8,10,28000,9\n";
    assert!(recorded::is_recording(text.as_bytes()));
    let read = |options: &Options| {
        let recording =
            series::read_text("a.csv", text, None, None, RequiredData::Samples).unwrap();
        recorded::waves(recording, options)
    };
    let waves = read(&Options::default()).unwrap();
    assert_eq!(waves.records.len(), 2, "one for each segment");
    assert_eq!(names(&waves.records[0]), ["fx_N", "mz_Nm"]);
    assert_eq!(waves.records[1].channels[1].axis, Some(5));
    assert_eq!(waves.records[1].auxiliary[&Channel::Feed], [0.01, 0.01]);
    let options_for = |name: &str| Options { columns: vec![name.to_owned()], ..Options::default() };
    let other = read(&options_for("sound")).unwrap();
    assert_eq!(other.records[0].channels[0].values, [7.0, 8.0]);
    let angle = read(&options_for("q1_deg")).unwrap();
    assert!(
        (angle.records[1].channels[0].values[0] - 6.0).abs() < 1e-12,
        "in degrees, as its name says"
    );
    let missing = read(&options_for("sond")).unwrap_err();
    assert!(missing.to_string().contains("did you mean `sound`?"), "{missing}");
}

#[test]
fn every_fault_of_a_table_is_reported_with_its_place() {
    let text = "t_s,a,b\n0,1,2\n0.1,x,2\n0.1,3,inf\n0.2,1,2\n0.3,1,2\n0.4,1\n0.5,1,2\n";
    insta::assert_snapshot!(parsed(text, &Options::default()).unwrap_err(), @r"
        error: `a`: `x` is not a number
         --> a.csv:3:5
          |
        3 | 0.1,x,2
          |     ^ expected a number

        error: `t_s`: stays at 0.1
         --> a.csv:4:1
          |
        4 | 0.1,3,inf
          | ^^^ expected increasing values
          |
          = help: give the sampling rate if the samples are evenly spaced

        error: `b`: is infinite
         --> a.csv:4:7
          |
        4 | 0.1,3,inf
          |       ^^^ expected a finite number, or nothing

        error: this row has 2 fields
         --> a.csv:7:1
          |
        7 | 0.4,1
          | ^^^^^ expected 3, like the header
        ");
}

#[test]
fn labview_files_are_read_with_units_rate_and_several_sections() {
    let header =
        "LabVIEW Measurement\t\nSeparator\tTab\nX_Columns\tOne\n***End_of_Header***\t\n\t\n";
    let section = |x: &[&str]| {
        let rows: Vec<String> =
            x.iter().enumerate().map(|(i, x)| format!("{x}\t{i}.5\t{i}\n")).collect();
        format!(
            "Channels\t2\t\nSamples\t4\t4\nY_Unit_Label\tN\tg\nX_Dimension\tTime\tTime\nX0\t0\t0\n\
             Delta_X\t0.001\t0.001\n***End_of_Header***\t\t\nX_Value\t Force\tAcceleration\tComment\n{}\n",
            rows.join("")
        )
    };
    let times = section(&["0.000", "0.001", "0.002", "0.003"]);
    let waves = parsed(&format!("{header}{times}{times}"), &Options::default()).unwrap();
    assert_eq!(waves.records.len(), 2);
    let record = &waves.records[1];
    assert_eq!(record.grid, Grid::Time { start_s: 0.0, rate_hz: 1000.0 });
    assert_eq!(names(record), ["Force", "Acceleration"]);
    assert_eq!((record.channels[0].unit.as_str(), record.channels[1].unit.as_str()), ("N", "g"));
    assert_eq!(record.channels[0].values, [0.5, 1.5, 2.5, 3.5]);
    let untimed =
        parsed(&format!("{header}{}", section(&["", "", "", ""])), &Options::default()).unwrap();
    assert_eq!(untimed.records[0].grid, Grid::Time { start_s: 0.0, rate_hz: 1000.0 });
    let thinned = parsed(
        &format!("{header}{}", section(&["0", "0.01", "0.02", "0.03"])),
        &Options::default(),
    );
    let thinned = thinned.unwrap();
    assert_eq!(thinned.records[0].grid, Grid::Time { start_s: 0.0, rate_hz: 100.0 });
    assert!(thinned.notes.iter().any(|note| note.contains("the column takes precedence")));
    for (from, to, reason) in [
        ("0.001\t0.001", "0.001\t0.002", "`Delta_X`: differs between the channels: 0.001, 0.002"),
        ("Time\tTime", "Frequency\tFrequency", "`X_Dimension`: is `Frequency`"),
    ] {
        let text = format!("{header}{}", times.replace(from, to));
        let fault = parsed(&text, &Options::default()).unwrap_err().to_string();
        assert!(fault.contains(reason), "{fault}");
    }
}

#[test]
fn universal_files_of_every_form_hold_the_same_hits_and_response() {
    for form in ["ascii-f64", "ascii-f32", "little-f64", "little-f32", "big-f64", "big-f32"] {
        let (path, bytes) = fixture(&format!("hits-{form}.uff"));
        let waves = parse(&path, bytes, &Options::default()).unwrap();
        assert_eq!(waves.records.len(), 2, "{form}");
        for (hit, record) in waves.records.iter().enumerate() {
            assert_eq!(record.grid, Grid::Time { start_s: 0.0, rate_hz: 1024.0 });
            assert_eq!(names(record), ["1-z", "2+x"]);
            assert_eq!((record.channels[0].axis, record.channels[1].axis), (Some(2), Some(0)));
            assert_eq!(record.channels[1].quantity(), Some((Quantity::Acceleration, 1.0)));
            for k in 0..48_usize {
                let force = if k == 3 + hit { 100.0 } else { 0.25 * hit as f64 };
                let ring = (-0.05 * k as f64).exp() * (0.7 * k as f64 + hit as f64).sin();
                assert!((record.channels[0].values[k] - force).abs() < 1e-6, "{form} {k}");
                assert!((record.channels[1].values[k] - ring).abs() < 1e-5, "{form} {k}");
            }
        }
        let [response] = waves.responses.as_slice() else { panic!("{form}") };
        assert_eq!((response.response.as_str(), response.reference.as_str()), ("2+x", "1-z"));
        assert_eq!(
            (response.response_unit.as_str(), response.reference_unit.as_str()),
            ("m/s^2", "N")
        );
        for (k, [re, im]) in response.values.iter().enumerate() {
            let w = 4.0 * k as f64;
            let (a, b) = (900.0 - w * w, 2.0 * w);
            let square = a * a + b * b;
            assert_eq!(response.frequency_hz[k], w);
            assert!((re - a / square).abs() < 1e-7 && (im + b / square).abs() < 1e-7, "{form} {k}");
        }
    }
}

#[test]
fn a_universal_file_that_is_cut_off_or_of_the_old_form_is_refused_with_a_reason() {
    let (path, bytes) = fixture("hits-little-f64.uff");
    let cut = parse(&path, bytes[..1000].to_vec(), &Options::default()).unwrap_err();
    assert!(cut.to_string().contains("truncated"), "{cut}");
    let text = String::from_utf8(fixture("hits-ascii-f64.uff").1).unwrap();
    let odd = text
        .replacen("        48 ", "        47 ", 1)
        .replace("1.00000000000e+02", "1.0000x000000e+02");
    let faults = parse(&path, odd.into_bytes(), &Options::default()).unwrap_err();
    assert_eq!(faults.len(), 2, "{faults}");
    let mut vax = bytes;
    let offset = vax.windows(2).position(|pair| pair == b" 2").unwrap();
    vax[offset + 1] = b'1';
    let refused = parse(&path, vax, &Options::default()).unwrap_err();
    assert!(refused.to_string().contains("IEEE 754"), "{refused}");
}

#[test]
fn wav_files_have_full_scale_one_by_default() {
    for (name, tolerance) in [("tone-i16.wav", 2e-5), ("tone-f32.wav", 1e-7)] {
        let (path, bytes) = fixture(name);
        let options =
            Options { full_scale: Some(20.0), columns: vec!["2".to_owned()], ..Options::default() };
        let one = parse(&path, bytes.clone(), &Options::default()).unwrap();
        let scaled = parse(&path, bytes, &options).unwrap();
        assert_eq!(one.records[0].grid, Grid::Time { start_s: 0.0, rate_hz: 8000.0 });
        assert_eq!(
            (names(&one.records[0]), names(&scaled.records[0])),
            (vec!["1", "2"], vec!["2"])
        );
        for k in 0..48_usize {
            let phase = std::f64::consts::TAU * k as f64 / 16.0;
            assert!((one.records[0].channels[0].values[k] - 0.5 * phase.sin()).abs() < tolerance);
            let value = scaled.records[0].channels[0].values[k];
            assert!((value - 5.0 * phase.cos()).abs() < 20.0 * tolerance, "{value}");
        }
    }
}

#[test]
fn files_of_other_programs_are_recognised_and_refused_with_a_remedy() {
    for (bytes, program) in
        [(&b"TDSm\x0e"[..], "TDMS"), (b"MATLAB 5.0 MAT-file", "MATLAB"), (b"PK\x03\x04", "zip")]
    {
        let refused = parse(Path::new("a"), bytes.to_vec(), &Options::default()).unwrap_err();
        assert!(
            refused.to_string().contains(program) && refused.to_string().contains("CSV"),
            "{refused}"
        );
    }
    assert!(parsed("", &Options::default()).is_err());
    let latin =
        parse(Path::new("a.txt"), b"t_s,Kraft_\xb5\n0,1\n1,2\n2,3\n".to_vec(), &Options::default());
    assert!(latin.unwrap().notes[0].contains("Latin-1"));
}

/// A file that is read, changed at some places.
fn mutated() -> impl Strategy<Value = (PathBuf, Vec<u8>)> {
    let lvm = "LabVIEW Measurement\t\nSeparator\tTab\n***End_of_Header***\t\nChannels\t1\nY_Unit_Label\tN\n\
        Delta_X\t0.001\n***End_of_Header***\t\nX_Value\tF\tComment\n0.0\t1\n0.1\t2\n0.2\t3\n";
    let good: Vec<(PathBuf, Vec<u8>)> = vec![
        fixture("hits-ascii-f32.uff"),
        fixture("hits-big-f32.uff"),
        fixture("tone-i16.wav"),
        fixture("tone-f32.wav"),
        (PathBuf::from("a.lvm"), lvm.as_bytes().to_vec()),
        (PathBuf::from("a.csv"), b"t_s,F_N,note\n0,1,a\n0.1,2,b\n0.2,,c\n0.3,4,d\n".to_vec()),
        (PathBuf::from("a.txt"), b"0 1 2\n1 2 3\n2 3 4\n3 4 5\n".to_vec()),
    ];
    let changes = prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0..3_u8), 0..6);
    (prop::sample::select(good), changes).prop_map(|((path, mut bytes), changes)| {
        for (offset, byte, way) in changes {
            let offset = offset.index(bytes.len().max(1)).min(bytes.len().saturating_sub(1));
            match way {
                0 if !bytes.is_empty() => bytes[offset] = byte,
                1 => bytes.insert(offset, byte),
                _ => bytes.truncate(offset + 1),
            }
        }
        (path, bytes)
    })
}

/// What every [`Waves`] promises.
fn holds(waves: &Waves) -> bool {
    let sound = |record: &Record| {
        let grid = match record.grid {
            Grid::Time { start_s, rate_hz } => {
                start_s.is_finite() && rate_hz > 0.0 && rate_hz.is_finite()
            }
            Grid::Length { start_mm, step_mm } => {
                start_mm.is_finite() && step_mm > 0.0 && step_mm.is_finite()
            }
        };
        let same_length = record.channels.iter().all(|wave| wave.values.len() == record.len());
        let finite = record.channels.iter().flat_map(|wave| &wave.values).all(|v| !v.is_infinite());
        grid && same_length && finite && !record.is_empty()
    };
    waves.records.iter().all(sound) && !(waves.records.is_empty() && waves.responses.is_empty())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]
    #[test]
    fn no_bytes_make_a_reader_panic(
        bytes in prop::collection::vec(any::<u8>(), 0..300),
        text in "[-0-9eED+., ;\t\n#ab]{0,300}",
        head in prop::sample::select(vec!["", "RIFF", "LabVIEW Measurement\n***End_of_Header***\n", "    -1\n    58\n", "    -1\n    58b     1     2\n"]),
        rate in prop::option::of(Just(1000.0)),
    ) {
        let options = Options { rate_hz: rate, ..Options::default() };
        for tail in [bytes.as_slice(), text.as_bytes()] {
            let file = [head.as_bytes(), tail].concat();
            match parse(Path::new("a"), file, &options) {
                Ok(waves) => prop_assert!(holds(&waves), "{waves:?}"),
                Err(faults) => prop_assert!(!faults.plain().is_empty()),
            }
        }
    }

    #[test]
    fn a_changed_file_is_read_or_refused_and_never_more((path, bytes) in mutated()) {
        match parse(&path, bytes, &Options::default()) {
            Ok(waves) => prop_assert!(holds(&waves), "{waves:?}"),
            Err(faults) => prop_assert!(!faults.plain().is_empty()),
        }
    }

    #[test]
    fn written_samples_come_back_to_the_same_bits(
        values in prop::collection::vec(-1e9..1e9_f64, 8..40), rate_hz in 10.0..1e5_f64,
    ) {
        let mut text = "t_s,F_N\n".to_owned();
        for (i, value) in values.iter().enumerate() {
            text += &format!("{},{value}\n", i as f64 / rate_hz);
        }
        let waves = parsed(&text, &Options::default()).unwrap();
        prop_assert_eq!(&waves.records[0].channels[0].values, &values);
        let Grid::Time { rate_hz: found, .. } = waves.records[0].grid else { panic!() };
        prop_assert!((found / rate_hz - 1.0).abs() < 2e-6, "{} for {}", found, rate_hz);
    }
}
