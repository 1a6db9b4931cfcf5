//! The formats a flow field can be written in: one variant and one arm each.

use super::fields::numbered;
use jacoflow::io::{FieldFormat, read_flo, read_kitti, read_npz, read_pfm};
use jacoflow::types::{SamplingGrid, Units};

#[test]
fn every_format_holds_the_flow() {
    let folder = tempfile::tempdir().unwrap();
    let mut field = numbered(SamplingGrid::default());
    // As the formats without units hold it.
    field.layout.units = Units::default();
    for format in FieldFormat::ALL {
        assert_eq!(FieldFormat::parse(format.name()).unwrap(), format);
        let path = folder.path().join(format!("{}.{}", format.name(), format.extension()));
        format.write(&path, &field, "").unwrap();
        let v: Vec<f32> = match format {
            FieldFormat::Npz => read_npz::<f32>(&path).unwrap().field.plane("v").unwrap().to_vec(),
            FieldFormat::Flo => read_flo(&path).unwrap().v().to_vec(),
            FieldFormat::Kitti => read_kitti(&path).unwrap().v().to_vec(),
            FieldFormat::Pfm => read_pfm(&path).unwrap().planes[1].clone(),
        };
        assert_eq!(v, field.plane("v").unwrap(), "{format:?}");
    }
    assert!(FieldFormat::parse("gif").unwrap_err().to_string().contains("npz, flo, kitti, pfm"));
    assert!(
        FieldFormat::Flo.write(folder.path().join("p.flo"), &numbered(SamplingGrid::Points(vec![(0, 0)])), "").is_err()
    );
}
