"""Scaling chains: npTDMS's numbers where it computes them, an error where it would give raw counts."""

import numpy as np
import pytest
import tdms_bytes as tb
from nptdms import TdmsFile
from tdms_bytes import write

from specan.errors import InputError, NoSignalError
from specan.io.open import open_recording


class TestScaling:
    wave = {"wf_increment": 0.001}  # noqa: RUF012
    data = np.array([1, 2, 3, -4], dtype=np.int16)

    def opened(self, path, properties, data=None):
        write(path, [("c", self.data if data is None else data, {**self.wave, **properties})])
        recording = open_recording(path)
        expected = TdmsFile.read(path)["g"]["c"][:]
        return recording.read(recording.channels)[0], expected

    def test_polynomial(self, path):
        scale = {"NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Polynomial",
                 "NI_Scale[0]_Polynomial_Coefficients_Size": 3} | {
                     f"NI_Scale[0]_Polynomial_Coefficients[{k}]": v for k, v in enumerate((0.1, 2.0, 0.3))}  # fmt: skip
        read, expected = self.opened(path, scale)
        np.testing.assert_array_equal(read, expected)
        np.testing.assert_allclose(read, 0.1 + 2.0 * self.data + 0.3 * self.data**2, rtol=1e-14)

    def test_table(self, path):
        scale = {"NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Table",
                 "NI_Scale[0]_Table_Pre_Scaled_Values_Size": 2, "NI_Scale[0]_Table_Scaled_Values_Size": 2,
                 "NI_Scale[0]_Table_Pre_Scaled_Values[0]": -4.0, "NI_Scale[0]_Table_Pre_Scaled_Values[1]": 4.0,
                 "NI_Scale[0]_Table_Scaled_Values[0]": 0.0, "NI_Scale[0]_Table_Scaled_Values[1]": 1.0}  # fmt: skip
        read, expected = self.opened(path, scale)
        np.testing.assert_array_equal(read, expected)
        np.testing.assert_allclose(read, (self.data + 4) / 8)

    def test_a_chain_of_two(self, path):
        scale = {**tb.linear(2.0, 1.0), **tb.linear(10.0, 0.0, number=1, source=0)}
        read, expected = self.opened(path, scale)
        np.testing.assert_array_equal(read, expected)
        np.testing.assert_array_equal(read, (2.0 * self.data + 1.0) * 10.0)

    def test_a_sum_of_two(self, path):
        scale = {**tb.linear(2.0), **tb.linear(10.0, number=1), "NI_Number_Of_Scales": 3,
                 "NI_Scale[2]_Scale_Type": "Add", "NI_Scale[2]_Add_Left_Operand_Input_Source": 0,
                 "NI_Scale[2]_Add_Right_Operand_Input_Source": 1}  # fmt: skip
        read, expected = self.opened(path, scale)
        np.testing.assert_array_equal(read, expected)
        np.testing.assert_array_equal(read, 12.0 * self.data)

    def test_single_precision_like_nptdms(self, path):
        data = np.linspace(-1, 1, 50, dtype=np.float32)
        read, expected = self.opened(path, tb.linear(0.1234567, 0.7654321), data)
        np.testing.assert_array_equal(read, expected.astype(np.float64))

    def test_scaled_by_the_writer(self, path):
        read, _ = self.opened(path, {**tb.linear(2.0), "NI_Scaling_Status": "scaled"})
        np.testing.assert_array_equal(read, self.data)

    @pytest.mark.parametrize(
        ("scale", "message"),
        [
            ({"NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Logarithm"}, "'Logarithm' is not known"),
            (tb.linear(2.0, source=0), "refers to itself"),
            ({**tb.linear(2.0, source=1), **tb.linear(3.0, number=1, source=0)}, "refers to itself"),
            (tb.linear(2.0, source=7), "refers to scale 7"),
            ({"NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Linear"}, "not complete"),
            ({"NI_Number_Of_Scales": 1}, "has no type"),
        ],
    )
    def test_a_scale_that_cannot_be_computed_is_an_error(self, path, scale, message):
        write(path, [("c", self.data, {**self.wave, **scale})])
        with pytest.raises(InputError, match=message) as caught:
            open_recording(path)
        assert not isinstance(caught.value, NoSignalError)  # the batch calls it a failure
        assert "a.tdms: 'c' cannot be scaled" in str(caught.value)

    def test_the_scale_of_the_group(self, path):
        write(path, [("c", self.data, self.wave)], group=tb.linear(3.0))
        recording = open_recording(path)
        np.testing.assert_array_equal(recording.read(recording.channels)[0], 3.0 * self.data)


def test_a_channel_that_cannot_be_scaled_costs_the_others_nothing(path):
    unknown = {"wf_increment": 0.001, "NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Logarithm"}
    write(path, [("good", np.ones(5), {"wf_increment": 0.001}), ("bad", np.ones(5), unknown)])
    recording = open_recording(path)
    assert [c.name for c in recording.channels] == ["good"]
    assert "'Logarithm' is not known" in recording.set_aside["g/bad"]
